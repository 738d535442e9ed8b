"""Why a predicted scan has no echo at all."""

import numpy as np

from sonarhw_sim.board.profile import Board
from sonarhw_sim.check.plan_check import LARGE, extent
from sonarhw_sim.room.model import Place, Room
from sonarhw_sim.room.outside import wall_distances


def reason_for_silence(room: Room, place: Place, board: Board) -> str:
    """Return why `board` receives nothing at `place`: too far away, too near, or too faint."""
    nearest, farthest = _distances(room, place)
    if nearest > board.max_range:
        doubt = "; are the coordinates in centimetres or millimetres? expected metres"
        unit = doubt if max(extent(room)) > LARGE else ""
        return (
            f"the nearest wall is {nearest:.3g} m away, and board {board.name!r} reports at most "
            f"{board.max_range:g} m{unit}"
        )
    if farthest < board.blanked_range(room.air):
        return (
            f"the farthest wall is {farthest:.3g} m away, and board {board.name!r} detects nothing nearer than "
            f"{board.blanked_range(room.air):.3g} m (blanking)"
        )
    return (
        f"within {board.max_range:g} m, nothing is above the threshold of board {board.name!r} "
        f"({board.threshold_db:g} dB); try more headings, or check the reflectances and the threshold"
    )


def _distances(room: Room, place: Place) -> tuple[float, float]:
    """Return the distance from a place to the nearest point and to the farthest end of walls and posts, m."""
    position = np.array(place.position)
    to_posts = np.hypot(*(room.posts[:, :2] - position).T)
    near = np.concatenate((wall_distances(position[None], room.walls)[0], to_posts - room.posts[:, 2]))
    far = np.concatenate((np.hypot(*(room.walls.reshape(-1, 2) - position).T), to_posts + room.posts[:, 2]))
    return float(near.min()), float(far.max())
