"""Scans are placed when the room found so far explains them; the rest is left out."""

from types import SimpleNamespace

import numpy as np
import pytest
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.locate.poses import Pose
from sonarhw_compare.room_finding import unknown_poses
from sonarhw_compare.room_finding.draft import RoomDraft
from sonarhw_compare.room_finding.evidence import PoseSpread
from sonarhw_compare.room_finding.unknown_poses import find_room_and_poses
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.model import Place

from sonarhw.errors import InputError

BOARD = load_board("polaroid-6500")
NOWHERE = Place("", (0.0, 0.0))


def scans(count: int) -> list[PlacedScan]:
    return [PlacedScan((), NOWHERE, str(k), str(k)) for k in range(count)]


def pose(x: float, probability: float = 1.0) -> Pose:
    return Pose((x, 0.0), 0.1, 0.0, probability, (0.01, 0.01, 0.01))


def with_shares(monkeypatch: pytest.MonkeyPatch, shares: dict[int, list[float]]) -> list[int]:
    """Let the room explain these shares of each waiting scan, one after the other; return the sizes of the rooms."""
    sizes: list[int] = []

    def find_room(given: list[PlacedScan], *_: object) -> object:
        sizes.append(len(given))
        return SimpleNamespace(draft=RoomDraft(tuple(scan.place for scan in given)), explained=80, echoes=100)

    def located(_scans: object, waiting: list[int], *_: object) -> dict[int, tuple[float, tuple[Pose, ...]]]:
        return {k: (shares[k].pop(0), (pose(float(k)),)) for k in waiting}

    monkeypatch.setattr(unknown_poses, "find_room", find_room)
    monkeypatch.setattr(unknown_poses, "_located", located)
    return sizes


def test_well_explained_scans_come_first_then_the_best_and_foreign_ones_never(monkeypatch: pytest.MonkeyPatch) -> None:
    # the room explains 0.8 of its own scans: 0.4 is enough at once, less than 0.2 never
    shares = {1: [0.5], 2: [0.3, 0.3], 3: [0.1, 0.1, 0.1], 4: [0.45]}
    sizes = with_shares(monkeypatch, shares)
    result = find_room_and_poses(scans(5), BOARD, Air(), [PoseSpread(), None, None, None, None])
    assert sizes == [1, 3, 4]
    assert [scan.title for scan in result.scans] == ["0", "1", "2", "4"]
    assert [scan.place.position[0] for scan in result.scans] == [0.0, 1.0, 2.0, 4.0]
    assert result.left_out == ("3",)
    assert list(result.poses) == ["1", "2", "4"]


def test_known_poses_need_one_room(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes = with_shares(monkeypatch, {})
    ticks: list[float] = []
    result = find_room_and_poses(scans(2), BOARD, Air(), (), ticks.append)
    assert sizes == [2]
    assert (result.left_out, result.poses) == ((), {})
    assert ticks[-1] == 1.0
    assert np.diff(ticks).min(initial=0.0) >= 0.0


def test_without_a_known_pose_nothing_is_found() -> None:
    with pytest.raises(InputError, match="no pose is known"):
        find_room_and_poses(scans(2), BOARD, Air(), [None, None])
