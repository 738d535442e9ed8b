"""The tables of docs/devices/firmware.md match the sources."""

import re

from tests.system.firmware.combinations.images import FIRMWARE, budgets, combinations
from tests.system.firmware.emulated.test_emulated_board import FREE_STACK, OTHER_VARIABLES, TRACE_STORE

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
