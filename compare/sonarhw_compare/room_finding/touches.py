"""Where the paths that explain the readings touch the walls and posts of a draft."""

from dataclasses import dataclass, replace

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_compare.matching.match import compare_readings
from sonarhw_compare.room_finding.draft import DraftEnd, RoomDraft
from sonarhw_compare.room_finding.evidence import FOLLOWED, REFLECTANCE, Evidence, as_found

_BEFORE = 0.99  # share of the way to a corner, before which a wall hides it


@dataclass(frozen=True)
class Touches:
    """The points at which sound has touched each surface on its way to a recorded echo."""

    walls: dict[int, FloatArray]  # by key: m along the wall from its middle
    posts: tuple[int, ...]  # number of touches of each post
    echoes: tuple[int, ...]  # by scan: their number
    unexplained: tuple[int, ...]  # by scan: number of echoes without a path


def touches_of(evidence: Evidence, draft: RoomDraft) -> Touches:
    """Return the touches of the paths that explain readings within 5 cm, reflected or diffracted there."""
    room, board = draft.room(REFLECTANCE, evidence.air), as_found(evidence.board, draft)
    walls: dict[int, list[float]] = {key: [] for key in draft.walls}
    posts, echoes, unexplained = [0] * len(draft.posts), [], []
    for scan, place in zip(evidence.scans, draft.places, strict=True):
        comparison = compare_readings(scan.readings, room, board.faced(place), board, FOLLOWED)
        paths = comparison.prediction.paths
        echoes.append(sum(row.measured is not None for row in comparison.rows))
        unexplained.append(sum(row.measured is not None and row.path is None for row in comparison.rows))
        for row in comparison.rows:
            if row.path is None:
                continue
            outline = paths.outline(row.path)[1:-1]
            for point in outline:
                for key in draft.walls:
                    at = _on(draft, key, point)
                    if at is not None:
                        walls[key].append(at)
                for number, post in enumerate(draft.posts):
                    posts[number] += bool(abs(np.hypot(*(point - post.center)) - post.radius) < 1e-6)
    return Touches({key: np.array(at) for key, at in walls.items()}, tuple(posts), tuple(echoes), tuple(unexplained))


def _on(draft: RoomDraft, key: int, point: FloatArray) -> float | None:
    """Return where a point lies on a wall, m along it from its middle; None if it is elsewhere."""
    wall = draft.walls[key]
    away = point - wall.middle
    at = float(away @ wall.along)
    first, last = draft.extent(key)
    return at if abs(float(away @ wall.normal)) < 1e-6 and first - 1e-6 <= at <= last + 1e-6 else None


def _is_hidden(draft: RoomDraft, key: int, which: int) -> bool:
    """Return whether other walls are between an end of a wall and every place."""
    point = draft.segment(key)[2 * which : 2 * which + 2]
    starts, along = draft.segments[:, :2], draft.segments[:, 2:] - draft.segments[:, :2]
    for place in draft.places:
        sight = point - place.position
        away = starts - place.position
        across = sight[0] * along[:, 1] - sight[1] * along[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):  # walls along the line of sight
            on_sight = (away[:, 0] * along[:, 1] - away[:, 1] * along[:, 0]) / across
            on_wall = (away[:, 0] * sight[1] - away[:, 1] * sight[0]) / across
        before = (on_sight > 0) & (on_sight < _BEFORE) & (on_wall >= 0) & (on_wall <= 1)
        if not before.any():
            return False
    return True


def trimmed(draft: RoomDraft, touches: Touches, first: RoomDraft, only: int | None = None) -> RoomDraft:
    """Return the draft with free ends moved back to the outermost touches; what has no touches is removed.

    A corner that no place sees counts as a free end.
    The walls and posts of `first` stay as they are. `only`: the key of the one wall that is changed.
    """
    for key in sorted(draft.walls.keys() - first.walls.keys()):
        if only not in (None, key):
            continue
        at = touches.walls[key]
        if not len(at):
            draft = draft.without_wall(key)
            continue
        wall = draft.walls[key]
        for which, outermost in ((0, float(at.min())), (1, float(at.max()))):
            if draft.is_free(key, which) or _is_hidden(draft, key, which):
                wall = wall.with_end(which, DraftEnd(outermost))
        draft = draft.with_wall(key, wall)
    if only is not None:
        return draft
    kept = len(first.posts)
    touched = zip(draft.posts[kept:], touches.posts[kept:], strict=True)
    return replace(draft, posts=(*draft.posts[:kept], *(post for post, count in touched if count)))
