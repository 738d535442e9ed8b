"""Structure of the firmware: few files per folder, unique names, no circular includes."""

from collections import Counter

import pytest

from tests.system.firmware.combinations.images import FIRMWARE, combinations, sources

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
