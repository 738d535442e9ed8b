"""Change the code in random places, and print the changes that no test detects.

python -m tests.mutation --sample 100 --seed 1 --folders sonarhw/host sim/sonarhw_sim/rays
"""

import argparse
import hashlib
import json
import math
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from multiprocessing import get_context
from pathlib import Path

from tests.mutation.covering import Covering
from tests.mutation.equivalents import is_equivalent
from tests.mutation.mutants import Mutant, mutants_of
from tests.mutation.trial import Tree, preload

CHECKOUT = Path(__file__).parents[2]
PACKAGES = ("sonarhw", "sim/sonarhw_sim", "compare/sonarhw_compare")
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

    folder: str
    mutant: Mutant
    tests: tuple[str, ...]
    seconds: float  # recorded duration of the tests


def main() -> int:
    """Run the command line. The exit status is 1 if fewer mutants of any folder than `--least` are detected."""
    options = _options()
    recorded = Path(options.recorded or tempfile.mkdtemp(prefix="recorded-")).resolve()
    record(recorded)
    covering = Covering(CHECKOUT, recorded, [path for paths in SOURCES.values() for path in paths])
    trials = [trial for folder in options.folders for trial in _trials(folder, covering, options.sample, options.seed)]
    survived = run(trials, options.processes, Results(recorded / "results.jsonl"))
    return _report(trials, survived, options.least)


def _sources() -> dict[str, list[str]]:
    """Return the source files of each folder of the packages, relative to the checkout."""
    sources: dict[str, list[str]] = {}
    for package in PACKAGES:
        for file in sorted((CHECKOUT / package).rglob("*.py")):
            path = file.relative_to(CHECKOUT)
            sources.setdefault(path.parent.as_posix(), []).append(path.as_posix())
    return sources


SOURCES = _sources()


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__.splitlines()[0])
    parser.add_argument("--sample", type=int, default=100, help="mutants of each folder (default: 100)")
    parser.add_argument("--seed", type=int, default=0, help="selects the sample (default: 0)")
    folders = f"default: all, which are {', '.join(SOURCES)}"
    parser.add_argument("--folders", nargs="+", choices=SOURCES, default=[*SOURCES], metavar="FOLDER", help=folders)
    parser.add_argument("--processes", type=int, default=os.cpu_count(), help="default: one for each core")
    parser.add_argument("--recorded", metavar="DIR", help="keep what ran, and continue from it after an interruption")
    parser.add_argument("--least", type=float, default=0.0, help="share that must be detected in each folder, 0 to 1")
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


class Results:
    """Which mutants survived, in a file to which each result is appended: an interrupted run continues from it.

    A result holds for the sources and tests of its time. Those of others are left in the file, and are not used.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        digest = hashlib.sha256()
        sources = [CHECKOUT / path for paths in SOURCES.values() for path in paths]
        for path in sorted([*sources, *(CHECKOUT / "tests").rglob("*.py")]):
            digest.update(path.read_bytes())
        self._state = digest.hexdigest()[:16]
        self._survived: dict[str, bool] = {}
        for line in file.read_text(encoding="utf-8").splitlines() if file.exists() else ():
            row = json.loads(line)
            if row["state"] == self._state:
                self._survived[row["key"]] = row["survived"]

    def get(self, mutant: Mutant) -> bool | None:
        """Return whether a mutant survived, or None if it has not been tried."""
        return self._survived.get(_key(mutant))

    def add(self, mutant: Mutant, survived: bool) -> None:
        """Append a result."""
        with self._file.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"state": self._state, "key": _key(mutant), "survived": survived}) + "\n")


def _key(mutant: Mutant) -> str:
    return json.dumps(asdict(mutant), sort_keys=True)


def run(trials: Sequence[Trial], processes: int, results: Results) -> list[Trial]:
    """Return the trials whose mutants no test detects, and print each. Mutants in `results` are not tried again."""
    context = get_context("fork")
    preload()
    survivors = [trial for trial in trials if results.get(trial.mutant)]
    left = [trial for trial in trials if results.get(trial.mutant) is None]
    if len(left) < len(trials):
        print(f"{len(trials) - len(left)} of {len(trials)} mutants were tried before")
    with tempfile.TemporaryDirectory(prefix="mutation-") as place, ProcessPoolExecutor(processes, context) as pool:
        controls = [_unchanged(trial) for trial in {trial.folder: trial for trial in left if trial.tests}.values()]
        if not all(pool.map(_survives, controls, [place] * len(controls))):
            raise SystemExit("tests fail without a mutant; record again, into another folder")
        started = {pool.submit(_survives, trial, place): trial for trial in left}
        for number, done in enumerate(as_completed(started), 1):
            trial, survived = started[done], done.result()
            results.add(trial.mutant, survived)
            if survived:
                survivors.append(trial)
            result = ("SURVIVED" if trial.tests else "NOT RUN ") if survived else "detected"
            print(f"{number}/{len(left)} {result} {trial.mutant}", flush=True)
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


def _trials(folder: str, covering: Covering, sample: int, seed: int) -> Iterator[Trial]:
    mutants = [mutant for path in SOURCES[folder] for mutant in mutants_of(path, (CHECKOUT / path).read_bytes())]
    mutants = [mutant for mutant in mutants if not is_equivalent(mutant)]
    chosen = random.Random(f"{seed} {folder}").sample(mutants, min(sample, len(mutants)))
    for mutant in chosen:
        tests: list[str] = []
        seconds = 0.0
        for test in covering.tests(mutant.path, mutant.line):
            seconds += covering.duration(test)
            if tests and seconds > _MOST_SECONDS:
                break
            tests.append(test)
        yield Trial(folder, mutant, tuple(tests), min(seconds, _MOST_SECONDS))


def _report(trials: Sequence[Trial], survivors: Sequence[Trial], least: float) -> int:
    print("\nnot detected:" if survivors else "")
    for trial in survivors:
        print(f"  {trial.mutant}   {f'{len(trial.tests)} tests' if trial.tests else 'no test executes this line'}")
    folders = dict.fromkeys(trial.folder for trial in trials)
    shares = [_print_share(name, [trial for trial in trials if trial.folder == name], survivors) for name in folders]
    _print_share("all", trials, survivors)
    return int(min(shares, default=1.0) < least)


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
