"""Notes on readings: kept beside the log, found again, and not lost by damage, other programs or a changed log."""

import csv
import os
from dataclasses import replace
from pathlib import Path

import pytest
from sonarhw_compare.scans import note_on, note_text, notes_of_log, notes_path, read_notes, save_notes

from sonarhw.errors import InputError
from sonarhw.log import read_log
from tests.fixtures.example_logs import write_example


@pytest.fixture
def log(tmp_path: Path) -> Path:
    write_example(tmp_path / "scan.mcap")
    return tmp_path / "scan.mcap"


def pin(log: Path, **texts: str) -> None:
    """Save notes; `r3="text"` is on reading 3."""
    readings = read_log(log).readings
    save_notes(notes_path(log), [note_on(readings[int(name[1:])], text) for name, text in texts.items()])


def test_the_file_has_the_documented_columns(log: Path) -> None:
    pin(log, r4="edge", r2="silent")
    rows = list(csv.DictReader(notes_path(log).read_text().splitlines()))
    assert list(rows[0]) == ["sweep", "reading", "heading_deg", "range_m", "note"]
    assert [row["reading"] for row in rows] == ["2", "4"]
    assert rows[0]["range_m"] == ""
    assert float(rows[1]["heading_deg"]) == 20.0
    assert float(rows[1]["range_m"]) == pytest.approx(read_log(log).readings[4].range, abs=1e-6)
    assert notes_path(log) == log.parent / "scan.notes.csv"


def test_an_empty_text_deletes_a_note_and_the_last_one_the_file(log: Path) -> None:
    pin(log, r4="edge", r5="other")
    pin(log, r4="")
    assert notes_of_log(log, read_log(log).readings).texts == {5: "other"}
    pin(log, r5="")
    assert not notes_path(log).exists()


def test_lines_that_are_not_notes_are_kept_as_they_are(log: Path) -> None:
    pin(log, r4="edge")
    with notes_path(log).open("ab") as file:
        file.write(b"1,seven,0,,text\nhalf a li\n1,5,25,0.35,\xff\xfe\n0,1,5,,zero\n")
    found = notes_of_log(log, read_log(log).readings)
    assert found.texts == {4: "edge"}
    damaged, changed = found.doubts
    assert "scan.notes.csv: 3 lines are not a note, the first is line 3" in damaged
    assert "1 note belongs to a reading that scan.mcap does not contain" in changed
    pin(log, r6="another")
    kept = notes_path(log).read_bytes()
    for line in (b"1,seven,0,,text\n", b"half a li\n", b"1,5,25,0.35,\xff\xfe\n", b"0,1,5,,zero\n"):
        assert line in kept


@pytest.mark.parametrize("content", [b"name,age\nx,5\n", b"\xff\xfe\x00\x01", b'"' + b"x" * 200_000])
def test_a_file_that_holds_no_notes_is_never_overwritten(log: Path, content: bytes) -> None:
    notes_path(log).write_bytes(content)
    (doubt,) = notes_of_log(log, read_log(log).readings).doubts
    assert doubt.startswith(str(notes_path(log)))
    assert "\n" not in doubt
    with pytest.raises(InputError):
        pin(log, r4="edge")
    assert notes_path(log).read_bytes() == content


def test_a_pipe_is_refused_without_waiting(log: Path) -> None:
    os.mkfifo(notes_path(log))
    assert "is not a file" in notes_of_log(log, read_log(log).readings).doubts[0]


def test_notes_of_a_changed_log_stay_in_the_file_and_on_no_reading(log: Path) -> None:
    pin(log, r4="edge", r6="post")
    readings = list(read_log(log).readings)
    readings[4] = replace(readings[4], angle=readings[4].angle + 0.1)
    found = notes_of_log(log, readings)
    assert found.texts == {6: "post"}
    assert "the log has changed" in found.doubts[0]
    assert len(read_notes(notes_path(log)).notes) == 2


def test_a_note_is_one_line_without_control_characters() -> None:
    assert note_text("  two\nlines\tof \x1b[31mtext  ") == "two lines of \\x1b[31mtext"
    assert len(note_text("x" * 2000)) == 500
