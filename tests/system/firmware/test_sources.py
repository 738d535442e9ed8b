"""Sources of the firmware: their structure, generated files, and the tables of docs/devices/firmware.md."""

import ctypes
import re
import subprocess
import sys
import zlib
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from tests.system.firmware.combinations.images import FIRMWARE, budgets, combinations, sources
from tests.system.firmware.emulated.test_emulated_board import FREE_STACK, OTHER_VARIABLES, TRACE_STORE

CORE = FIRMWARE / "core"
HOST = [*(FIRMWARE / "host").glob("*.[ch]"), *(FIRMWARE / "parts" / "polaroid").iterdir()]
HOST += [*(FIRMWARE / "parts" / "step-dir").iterdir(), *(FIRMWARE / "one-memory").iterdir()]
BOARDS = {"host": HOST, **{name: sources(name) for name in combinations() + combinations("PROGRAMS")}}


@pytest.mark.parametrize("board", BOARDS)
def test_file_names_are_unique_on_the_include_path(board: str) -> None:
    names = Counter(file.name for file in [*CORE.rglob("*.[ch]"), *BOARDS[board]])
    assert [name for name, times in names.items() if times > 1] == []


def test_a_folder_has_at_most_twelve_files_or_fifteen_for_a_board() -> None:
    for folder in [path for path in FIRMWARE.rglob("*") if path.is_dir() and "build" not in path.parts]:
        files = [file for file in folder.iterdir() if file.suffix in (".c", ".h")]
        assert len(files) <= (15 if folder == FIRMWARE / "avr" else 12), folder


def test_the_portable_part_mentions_no_chip() -> None:
    for file in [*CORE.rglob("*.[ch]"), *(FIRMWARE / "parts").rglob("*.h")]:
        text = file.read_text()
        assert "avr" not in text.lower(), file
        assert "#ifdef" not in text, file


# the document


DOCUMENT = (FIRMWARE.parent / "docs" / "devices" / "firmware.md").read_text()


def test_documented_budgets_match_the_comments_at_the_handlers() -> None:
    commented: dict[tuple[str, str], int] = {}
    for combination in combinations():
        commented |= budgets(combination)
    rows = re.findall(r"^\| `(\w+_vect)` \| `([\w-]+\.c)` .*? \| (\d+) \|", DOCUMENT, re.M)
    assert {(name, file): int(cycles) for name, file, cycles in rows} == commented


def test_documented_memory_matches_the_tested_limits() -> None:
    (memory,) = re.findall(r"\| memory \|.*\n\| --- \| --- \|\n((?:\|.*\n)+)", DOCUMENT)
    assert re.findall(r"\| (\d+) \|\n", memory) == [str(TRACE_STORE), str(OTHER_VARIABLES), str(FREE_STACK)]


def test_every_documented_file_exists() -> None:
    (listing,) = re.findall(r"```text\n(firmware/core/.*?)```", DOCUMENT, re.S)
    sources = {file.name for file in FIRMWARE.rglob("*.[ch]")}
    assert set(re.findall(r"[\w-]+\.[ch]\b", listing)) <= sources
    folders = {path.name for path in FIRMWARE.glob("*/*") if path.is_dir()}
    named = set(re.findall(r"^    (\w+)/ ", listing, re.M))
    assert {path.name for path in (FIRMWARE / "core").iterdir()} <= named <= folders
    assert all((FIRMWARE.parent / path).exists() for path in re.findall(r"^firmware/\S+", listing, re.M))


# generated files


def test_generated_files_are_up_to_date() -> None:
    check = subprocess.run([sys.executable, FIRMWARE / "generate.py", "--check"], capture_output=True, text=True)
    assert check.returncode == 0, check.stderr


@given(some.binary(max_size=300))
def test_the_checksum_is_that_of_zlib(built: Path, data: bytes) -> None:
    crc_of = ctypes.CDLL(str(built / "libsonar.so")).crc_of
    crc_of.restype = ctypes.c_uint32
    assert ~crc_of(0xFFFFFFFF, data, len(data)) & 0xFFFFFFFF == zlib.crc32(data)


@pytest.mark.parametrize("celsius", [-20.0, 0.0, 20.0, 25.0, 45.0])
def test_the_thermistor_table_matches_the_beta_equation(built: Path, celsius: float) -> None:
    table = np.array((ctypes.c_int16 * 33).in_dll(ctypes.CDLL(str(built / "libsonar.so")), "thermistor_table"))
    resistance = np.exp(3950 * (1 / (celsius + 273.15) - 1 / 298.15))  # relative to that at 25 °C
    ratio = resistance / (1 + resistance)
    assert np.interp(ratio * 32, np.arange(33), table) == pytest.approx(celsius * 100, abs=30)
