"""Change the code in random places, and print the changes that no test detects.

python -m tests.mutation --sample 100 --seed 1
"""

import argparse
import math
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

from tests.mutation.covering import Covering
from tests.mutation.equivalents import is_equivalent
from tests.mutation.mutants import Mutant, mutants_of
from tests.mutation.trial import Tree, preload

CHECKOUT = Path(__file__).parents[2]
PACKAGES = {"sonarhw": "sonarhw", "sonarhw_sim": "sim/sonarhw_sim", "sonarhw_compare": "compare/sonarhw_compare"}
TESTS = {
    "unit": ["tests/unit"],
    "system": ["tests/system/sonarhw", "tests/system/sim", "tests/system/compare", "tests/system/cli"],
    "contract": ["tests/contract"],
}
_MOST_SECONDS = 60.0  # of tests for one mutant, by their recorded durations; quickest first
_NOT_COPIED = shutil.ignore_patterns(
    ".git", ".venv*", "build", "*.egg-info", ".mypy_cache", ".ruff_cache", ".hypothesis"
)


@dataclass(frozen=True)
class Trial:
    """One mutant and the tests that may detect it."""

    package: str
    mutant: Mutant
    tests: tuple[str, ...]
    seconds: float  # recorded duration of the tests


def main() -> int:
    """Run the command line. The exit status is 1 if fewer mutants than `--least` are detected."""
    options = _options()
    recorded = Path(options.recorded or tempfile.mkdtemp(prefix="recorded-")).resolve()
    record(recorded)
    sources = {name: sorted(_sources(folder)) for name, folder in PACKAGES.items()}
    covering = Covering(CHECKOUT, recorded, [path for paths in sources.values() for path in paths])
    trials = []
    for name, paths in sources.items():
        if name in options.packages:
            trials += list(_trials(name, paths, covering, options.sample, options.seed))
    survivors = run(trials, options.processes)
    return _report(trials, survivors, options.least)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__.splitlines()[0])
    parser.add_argument("--sample", type=int, default=100, help="mutants of each package (default: 100)")
    parser.add_argument("--seed", type=int, default=0, help="selects the sample (default: 0)")
    parser.add_argument("--packages", nargs="+", choices=PACKAGES, default=[*PACKAGES], help="default: all three")
    parser.add_argument("--processes", type=int, default=os.cpu_count(), help="default: one for each core")
    parser.add_argument("--recorded", metavar="DIR", help="keep and reuse the record of which test executes which line")
    parser.add_argument("--least", type=float, default=0.0, help="share of mutants that must be detected, 0 to 1")
    return parser.parse_args()


def record(folder: Path) -> None:
    """Run the tests once, and record which test executes which line and how long each takes. Keep earlier records."""
    folder.mkdir(parents=True, exist_ok=True)
    for area, tests in TESTS.items():
        coverage = folder / f"{area}.coverage"
        if coverage.exists():
            continue
        print(f"recording {' '.join(tests)}", flush=True)
        command = [
            sys.executable,
            "-m",
            "pytest",
            *tests,
            "-p",
            "no:cacheprovider",
            "-vv",
            "--durations=0",
            "--color=no",
        ]
        command += ["--cov", "--cov-context=test", "--cov-report=", "--cov-fail-under=0"]
        with (folder / f"{area}.log").open("w") as log:
            ended = subprocess.run(command, cwd=CHECKOUT, env=os.environ | {"COVERAGE_FILE": str(coverage)}, stdout=log)
        if ended.returncode:
            coverage.unlink(missing_ok=True)
            raise SystemExit(f"{folder / area}.log: tests fail without a mutant; repair them first")


def run(trials: Sequence[Trial], processes: int) -> list[Trial]:
    """Return the trials whose mutants no test detects, and print each."""
    survivors = []
    context = get_context("fork")
    preload()
    with tempfile.TemporaryDirectory(prefix="mutation-") as place, ProcessPoolExecutor(processes, context) as pool:
        controls = [_unchanged(trial) for trial in {trial.package: trial for trial in trials if trial.tests}.values()]
        if not all(pool.map(_survives, controls, [place] * len(controls))):
            raise SystemExit("tests fail without a mutant; record again, into another folder")
        started = {pool.submit(_survives, trial, place): trial for trial in trials}
        for number, done in enumerate(as_completed(started), 1):
            trial, survived = started[done], done.result()
            if survived:
                survivors.append(trial)
            result = ("SURVIVED" if trial.tests else "NOT RUN ") if survived else "detected"
            print(f"{number}/{len(trials)} {result} {trial.mutant}", flush=True)
    return survivors


def _unchanged(trial: Trial) -> Trial:
    return replace(trial, mutant=replace(trial.mutant, begin=0, end=0, before="", after=""))


def _survives(trial: Trial, place: str) -> bool:
    if not trial.tests:
        return True
    tree = Path(place) / str(os.getpid())
    if not tree.exists():
        shutil.copytree(CHECKOUT, tree, symlinks=True, ignore=_NOT_COPIED)
        firmware = Path("firmware/build")
        if (CHECKOUT / firmware).exists():
            shutil.copytree(CHECKOUT / firmware, tree / firmware)
    return Tree(tree).survives(trial.mutant, trial.tests, trial.seconds)


def _sources(folder: str) -> Iterator[str]:
    for file in (CHECKOUT / folder).rglob("*.py"):
        yield str(file.relative_to(CHECKOUT))


def _trials(package: str, paths: Sequence[str], covering: Covering, sample: int, seed: int) -> Iterator[Trial]:
    found = [mutant for path in paths for mutant in mutants_of(path, (CHECKOUT / path).read_bytes())]
    mutants = [mutant for mutant in found if not is_equivalent(mutant)]
    chosen = random.Random(f"{seed} {package}").sample(mutants, min(sample, len(mutants)))
    for mutant in chosen:
        tests: list[str] = []
        seconds = 0.0
        for test in covering.tests(mutant.path, mutant.line):
            seconds += covering.duration(test)
            if tests and seconds > _MOST_SECONDS:
                break
            tests.append(test)
        yield Trial(package, mutant, tuple(tests), min(seconds, _MOST_SECONDS))


def _report(trials: Sequence[Trial], survivors: Sequence[Trial], least: float) -> int:
    print("\nnot detected:" if survivors else "")
    for trial in survivors:
        print(f"  {trial.mutant}   {f'{len(trial.tests)} tests' if trial.tests else 'no test executes this line'}")
    for package in sorted({trial.package for trial in trials}):
        _print_share(package, [one for one in trials if one.package == package], survivors)
    return int(_print_share("all", trials, survivors) < least)


def _print_share(name: str, trials: Sequence[Trial], survivors: Sequence[Trial]) -> float:
    total = len(trials)
    detected = total - sum(trial in survivors for trial in trials)
    low, high = wilson(detected, total)
    print(f"{name}: {detected} of {total} detected, {detected / total:.1%} (95 % interval {low:.1%} to {high:.1%})")
    return detected / total


def wilson(hits: int, total: int) -> tuple[float, float]:
    """Return the 95 % confidence interval of a share (Wilson 1927)."""
    z, share = 1.96, hits / total
    middle, half = share + z * z / (2 * total), z * math.sqrt(share * (1 - share) / total + z * z / (4 * total * total))
    return (middle - half) / (1 + z * z / total), (middle + half) / (1 + z * z / total)


if __name__ == "__main__":
    raise SystemExit(main())
