"""The tables of docs/how_to/firmware.md match the sources."""

import re

from tests.system.firmware.conftest import FIRMWARE
from tests.system.firmware.test_emulated_board import FREE_STACK, OTHER_VARIABLES, TRACE_STORE

DOCUMENT = (FIRMWARE.parent / "docs" / "how_to" / "firmware.md").read_text()


def test_documented_budgets_match_the_comments_at_the_handlers() -> None:
    sources = "".join(file.read_text() for file in sorted((FIRMWARE / "atmega2560").glob("*.c")))
    commented = {
        name: re.findall(r"Budget (\d+) cycles", comment)[0]
        for comment, name in re.findall(r"((?://.*\n)+)ISR\((\w+)\)", sources)
    }
    assert dict(re.findall(r"^\| `(\w+_vect)`.*? \| (\d+) \|", DOCUMENT, re.M)) == commented


def test_documented_memory_matches_the_tested_limits() -> None:
    (memory,) = re.findall(r"\| memory \|.*\n\| --- \| --- \|\n((?:\|.*\n)+)", DOCUMENT)
    assert re.findall(r"\| (\d+) \|\n", memory) == [str(TRACE_STORE), str(OTHER_VARIABLES), str(FREE_STACK)]


def test_every_documented_file_exists() -> None:
    (listing,) = re.findall(r"```text\n(firmware/core/.*?)```", DOCUMENT, re.S)
    sources = {file.name for file in FIRMWARE.rglob("*.[ch]")}
    assert set(re.findall(r"\w+\.[ch]\b", listing)) <= sources
    assert set(re.findall(r"^    (\w+)/ ", listing, re.M)) == {path.name for path in (FIRMWARE / "core").iterdir()}
    assert all((FIRMWARE.parent / path).exists() for path in re.findall(r"^firmware/\S+", listing, re.M))
