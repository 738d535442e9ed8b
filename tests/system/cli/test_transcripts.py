"""Commands print, and end with the status, that the transcripts in `transcripts/` show.

`tests/transcripts.py` describes their marks. Each runs in an empty folder, and its commands in one process.
"""

from pathlib import Path

import pytest

from tests.transcripts import Shell, differences, matches

PAGES = sorted((Path(__file__).parent / "transcripts").glob("*.md"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_print_what_the_transcript_shows(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    different = [*differences(page, Shell(tmp_path))]
    assert not different, "\n" + "\n".join(different)


def test_another_output_status_or_changed_file_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    page = tmp_path / "page.md"
    page.write_text(
        "```\n$ echo right\nwrong\n$ exit 1\n$ touch new; exit 2\n[2]\n$ sonarhw xyzzy\nsonarhw: …y'…\n[2]\n```\n"
    )
    assert [text.splitlines()[1] for text in differences(page, Shell(tmp_path))] == [
        "right",
        "[1]",
        "is refused, but changes files",
    ]


@pytest.mark.parametrize(
    ("shown", "same"),
    [("a 1\nb\nc\nd\n", True), ("a\nd\n", True), ("a\nd\nd\ne\n", False), ("ba\nd\n", False), ("", False)],
)
def test_an_ellipsis_is_any_text_in_a_line_or_any_lines(shown: str, same: bool) -> None:
    assert matches(shown, "a…\n…\nd\n") is same
