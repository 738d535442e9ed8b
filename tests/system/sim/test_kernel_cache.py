"""Compiled kernels on disk: whole commands with a cache of their own, which is damaged, outdated, full or missing."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.checkout import CHECKOUT
from tests.fixtures.commands import LINE_GONE, at_terminal, seen
from tests.hang_guard import HANG

# a model with few kernels
SIMULATE = ["simulate", "rooms/simple.toml", "--place", "figure9", "--model", "cone", "--step", "30"]
COMPILING = "sonarhw: Compiling the ray kernels, once per installation…\n"
RUN = [sys.executable, "-c", "from sonarhw_cli.entry import main; main()", *SIMULATE]


def simulated(cache: Path, *options: str, **environment: str) -> tuple[str, str]:
    """Return standard output and standard error of the command."""
    done = subprocess.run(
        [*RUN, *options],
        cwd=CHECKOUT,
        env=os.environ | {"NUMBA_CACHE_DIR": str(cache)} | environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=HANG,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


@pytest.fixture(scope="module")
def cached(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Return the cache and the output of a first command, which says at a terminal that it compiles."""
    cache = tmp_path_factory.mktemp("cache")
    output, shown = simulated_at_terminal(cache)
    assert COMPILING.removeprefix("sonarhw: ").rstrip() in shown
    assert "━" in shown  # the bar of the progress
    assert shown.endswith(LINE_GONE)
    assert output.count("\n") == 13
    return cache, output


def simulated_at_terminal(cache: Path) -> tuple[str, str]:
    with at_terminal(*SIMULATE, NUMBA_CACHE_DIR=str(cache)) as (process, person):
        shown = seen(person)
        output, _ = process.communicate(timeout=HANG)
    assert process.returncode == 0
    return output, shown


def test_a_second_command_compiles_nothing_and_says_nothing_of_it(cached: tuple[Path, str]) -> None:
    cache, output = cached
    before = {file: file.stat().st_ino for file in cache.iterdir()}
    assert simulated_at_terminal(cache) == (output, "")
    assert {file: file.stat().st_ino for file in cache.iterdir()} == before


def test_a_damaged_cache_heals(cached: tuple[Path, str], tmp_path: Path) -> None:
    whole, output = cached
    cache = shutil.copytree(whole, tmp_path / "cache")
    for number, file in enumerate(sorted(cache.iterdir())):
        contents = bytearray(file.read_bytes())
        if number % 2:
            del contents[len(contents) // 2 :]
        else:
            contents[len(contents) // 2] ^= 255
        file.write_bytes(contents)
    assert simulated(cache) == (output, COMPILING)
    loaded = {file.name for file in whole.iterdir() if "_nearest_hits" in file.name}
    assert loaded
    for name in loaded:
        assert len((cache / name).read_bytes()) > len((whole / name).read_bytes()) // 2
    before = {file: file.stat().st_ino for file in cache.iterdir()}
    assert simulated(cache) == (output, "")
    assert {file: file.stat().st_ino for file in cache.iterdir()} == before


def test_nothing_writable_warns_once(tmp_path: Path, cached: tuple[Path, str], monkeypatch: pytest.MonkeyPatch) -> None:
    simulated(cached[0], "--out", str(tmp_path / "cached.png"))
    monkeypatch.delenv("MPLCONFIGDIR", raising=False)
    picture = tmp_path / "compiled.png"
    nowhere = dict.fromkeys(("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME"), "/dev/null")
    _, error = simulated(Path("/dev/null/kernels"), "--out", str(picture), **nowhere)
    assert picture.read_bytes() == (tmp_path / "cached.png").read_bytes()
    assert error.count(COMPILING) == 1
    warning, written = error.replace(COMPILING, "").splitlines()
    assert warning.startswith("sonarhw: warning: compiled kernels cannot be stored")
    assert "/dev/null/kernels: Not a directory" in warning
    assert written == f"{picture}: written"


def test_a_changed_kernel_in_another_file_changes_the_next_command(cached: tuple[Path, str], tmp_path: Path) -> None:
    whole, before = cached
    cache = shutil.copytree(whole, tmp_path / "cache")
    package = shutil.copytree(
        CHECKOUT / "sim" / "sonarhw_sim", tmp_path / "sonarhw_sim", ignore=shutil.ignore_patterns("__pycache__")
    )
    path = os.pathsep.join((str(tmp_path), os.environ.get("PYTHONPATH", "")))
    kernel = package / "rays" / "fan.py"
    text = kernel.read_text()
    assert text.count("distance: float = ahead / across\n") == 1
    kernel.write_text(text.replace("distance: float = ahead / across\n", "distance: float = ahead / across + 0.5\n"))
    after, _ = simulated(cache, PYTHONPATH=path)
    ranges = [[float(line.split(",")[1]) for line in text.splitlines()[1:]] for text in (before, after)]
    assert [later - earlier for earlier, later in zip(*ranges, strict=True)] == pytest.approx([0.5] * 12)
