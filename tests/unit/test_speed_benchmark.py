"""The table of the speed benchmark, and its times, without the work that takes minutes."""

from collections.abc import Callable
from typing import Any

import pytest

from benchmarks import speed
from benchmarks.cases.table_rows import at_most


def test_the_time_of_work_is_the_least_of_three_runs_after_one_to_compile() -> None:
    now, lengths = [0.0], iter([90.0, 4.0, 2.0, 3.0])  # s

    def work() -> None:
        now[0] += next(lengths)

    assert speed.seconds(work, clock=lambda: now[0]) == 2.0


def test_the_table_has_a_line_for_each_row_and_marks_missed_requirements(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def at_once(work: Callable[[], object], *_rest: Any, **_clock: Any) -> float:
        return 0.25

    small = speed.office_floor(64)
    monkeypatch.setattr(speed, "seconds", at_once)
    monkeypatch.setattr(speed, "office_floor", lambda _walls: small)  # 10 000 walls take a second
    monkeypatch.setattr(speed, "memory_of_huge_scan", lambda: 200.0)
    monkeypatch.setattr(speed, "compare_with_image_sources", lambda: [at_most("images: times", 2, 3.0)])
    speed.main()
    machine, header, *rows = capsys.readouterr().out.splitlines()
    assert "numba" in machine
    assert header.split() == ["work", "required", "measured"]
    by_work = {line[:64].rstrip(): line[64:].split() for line in rows}
    assert by_work["whole scan, 64 walls: times 360 headings, processor time"] == ["-", "360.0"]
    assert by_work["whole scan, 1 000 walls: times that of 64 walls"] == ["≤", "3", "1.00"]
    assert by_work["trace of 62 ms at 1 MHz with 100 echoes: ms"] == ["≤", "1", "250.00", "missed"]
    assert by_work["memory of a scan in 10 000 walls, whole process: MB"] == ["≤", "300", "200.00"]
    assert by_work["images: times"] == ["≤", "2", "3.00", "missed"]
