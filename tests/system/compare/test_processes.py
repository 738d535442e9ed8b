"""Processes that compute parts of a search: same results, errors as they are, and an end with the search."""

import operator
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace

import pytest
from sonarhw_compare import processes as pool
from sonarhw_compare.locate import PoseSpread
from sonarhw_compare.processes import LateProcesses, Processes, Unfinished, call_apart
from sonarhw_compare.rooms import search
from sonarhw_compare.rooms.draft import draft_of_room
from sonarhw_compare.rooms.evidence import ROUGH, evidence_of
from sonarhw_compare.rooms.refinement import refined
from sonarhw_compare.rooms.search import find_room
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import Place, load_room

from sonarhw.errors import Cancelled, WorkersLost
from tests.fixtures.predicted_readings import predicted_scan
from tests.hang_guard import HANG

BOARD = load_board("hc-sr04")


@pytest.fixture
def two_cores(monkeypatch: pytest.MonkeyPatch) -> list[Processes]:
    """Two cores; returns the list of the processes that are started."""
    started = []

    def start(count: int, kept: object) -> Processes:
        started.append(Processes(count, kept))
        return started[-1]

    monkeypatch.setattr(pool, "core_count", lambda: 2)
    monkeypatch.setattr(pool, "Processes", start)
    return started


def go_on() -> None:
    """Let the processes compute to the end."""


def test_each_part_has_its_result_and_an_error_is_raised_as_it_is() -> None:
    processes = Processes(2, 12)
    try:
        assert processes.results(operator.truediv, [(3,), (4,)], go_on) == [4.0, 3.0]
        with pytest.raises(ZeroDivisionError, match="division by zero") as failed:
            processes.results(operator.truediv, [(3,), (0,)], go_on)
        assert "processes.py" in failed.value.__notes__[0]
        assert processes.results(operator.add, [(1,)], go_on) == [13]
        assert processes.results(operator.add, [(number,) for number in range(7)], go_on) == [*range(12, 19)]  # in turn
        processes.keep(20)
        assert processes.results(operator.add, [(1,), (2,)], go_on) == [21, 22]
        with pytest.raises(WorkersLost):
            processes.results(os._exit, [()], go_on)
    finally:
        processes.close()


def test_a_check_ends_the_wait_for_a_process() -> None:
    def check() -> None:
        raise Cancelled("the search was cancelled")

    processes = Processes(1, [])
    with pytest.raises(Cancelled):
        processes.results(select.select, [([], [])], check)  # waits for ever
    processes.close()
    assert len(processes) == 0


def test_processes_end_with_the_one_that_started_them_also_while_they_compute() -> None:
    script = (
        "import os, select, signal, threading; from sonarhw_compare.processes import Processes\n"
        "threading.Timer(2.0, os.kill, (os.getpid(), signal.SIGTERM)).start()\n"
        "Processes(2, []).results(select.select, [([], [])] * 2, lambda: None)"  # waits for ever
    )
    ended = subprocess.run([sys.executable, "-c", script], stderr=subprocess.PIPE, timeout=60, check=False)
    assert (ended.returncode != 0, ended.stderr) == (True, b"")


def test_two_processes_find_the_same_to_the_last_bit(two_cores: list[Processes]) -> None:
    room = load_room("simple")
    scans = [
        predicted_scan(room, Place(name, at), BOARD, 6.0)
        for name, at in (("a", (0.4, 0.3)), ("b", (0.6, 0.5)), ("c", (0.3, 0.5)))
    ]
    spreads = [PoseSpread(), PoseSpread(0.01, 0.02), PoseSpread(0.01, 0.02)]
    found = []
    for least in (10_000, 0):
        with LateProcesses(len(scans), least) as processes:
            evidence = evidence_of(scans, spreads, BOARD, room.air, None, processes)
            draft = replace(draft_of_room(room), places=evidence.first.places)
            drafts = [draft, draft.with_wall(0, draft.walls[0].moved(0.01, 0.02)), draft.without_wall(1)]
            likelihoods = evidence.log_likelihoods(drafts, ROUGH)
            found.append((likelihoods, repr(refined(evidence, drafts[1], ROUGH, 1, with_headings=True))))
    assert found[0] == found[1]
    assert [len(one) for one in two_cores] == [0]  # they have ended


def test_a_cancelled_search_ends_its_processes(two_cores: list[Processes], monkeypatch: pytest.MonkeyPatch) -> None:
    room = load_room("simple")
    scans = [predicted_scan(room, Place(name, at), BOARD, 6.0) for name, at in (("a", (0.4, 0.3)), ("b", (0.6, 0.5)))]
    monkeypatch.setattr(search, "LARGE", 0)

    def tick(_share: float) -> None:
        if two_cores:
            raise Cancelled("the search was cancelled")

    with pytest.raises(Cancelled):
        find_room(scans, BOARD, room.air, tick=tick)
    assert [len(one) for one in two_cores] == [0]


@pytest.mark.parametrize(
    ("function", "argument", "within", "message"),
    [
        (os._exit, 1, HANG, "crashes its parser"),
        (signal.raise_signal, signal.SIGSEGV, HANG, "crashes its parser"),
        (bytes, 2**40, HANG, "needs more than 4 GiB"),
        (time.sleep, HANG, 0.0, "takes more than 0 s"),
    ],
)
def test_foreign_code_ends(function: Callable[..., object], argument: int, within: float, message: str) -> None:
    with pytest.raises(Unfinished, match=message):
        call_apart(function, argument, within=within)
