"""Ways to change a draft: parts of its walls, posts and uncertain places."""

import math
from dataclasses import dataclass, replace

from sonarhw_sim.room.room import Place

from sonarhw_compare.room_finding.draft import DraftEnd, DraftPost, DraftWall, RoomDraft
from sonarhw_compare.room_finding.evidence import Evidence

_LENGTH, _TURN = 0.002, math.radians(0.2)  # m, rad: steps of the differences
_THINNEST = 0.005  # m, radius of a post


@dataclass(frozen=True)
class Move:
    """A way to change a draft: a part of a wall, of a post, of the place of a scan, or the range offset."""

    what: str  # "wall", "post", "place" or "offset"
    which: int  # key of the wall, or number of the post or scan
    part: int  # wall: to its left, turned, first and second end along it; post: x, y, radius; place: x, y, heading
    step: float  # m or rad, a small one

    def is_of(self, what: str, which: int) -> bool:
        """Return whether a wall, post or place is changed."""
        return (self.what, self.which) == (what, which)

    @property
    def is_turn(self) -> bool:
        """Whether the change is an angle."""
        return self.part == {"wall": 1, "place": 2}.get(self.what)

    def of(self, draft: RoomDraft, by: float) -> RoomDraft:
        """Return the draft changed by `by` (m or rad)."""
        match self.what:
            case "wall":
                return draft.with_wall(self.which, _moved_wall(draft, self.which, self.part, by))
            case "post":
                posts = list(draft.posts)
                values = [*posts[self.which].center, posts[self.which].radius]
                values[self.part] += by
                posts[self.which] = DraftPost((values[0], values[1]), max(values[2], _THINNEST))
                return replace(draft, posts=tuple(posts))
            case "offset":
                return replace(draft, offset=draft.offset + by)
            case _:
                places = list(draft.places)
                places[self.which] = _moved_place(places[self.which], self.part, by)
                return replace(draft, places=tuple(places))


def _moved_wall(draft: RoomDraft, key: int, part: int, by: float) -> DraftWall:
    wall = draft.walls[key]
    if part < 2:
        return wall.moved(by, 0.0) if part == 0 else wall.moved(0.0, by)
    return wall.with_end(part - 2, DraftEnd(draft.extent(key)[part - 2] + by))


def _moved_place(place: Place, part: int, by: float) -> Place:
    if part == 2:
        return replace(place, heading=place.heading + by)
    x, y = place.position
    return replace(place, position=(x + by, y) if part == 0 else (x, y + by))


def moves_of(evidence: Evidence, draft: RoomDraft) -> list[Move]:
    """Return all ways to change a draft: walls, posts, then the uncertain places."""
    moves = [Move("wall", key, part, step) for key in draft.walls for part, step in ((0, _LENGTH), (1, _TURN))]
    moves += [Move("wall", key, 2 + end, _LENGTH) for key in draft.walls for end in (0, 1) if draft.is_free(key, end)]
    moves += [Move("post", row, part, _LENGTH) for row in range(len(draft.posts)) for part in range(3)]
    for scan, spread in enumerate(evidence.spreads):
        moves += [Move("place", scan, part, _LENGTH) for part in (0, 1) if spread.xy > 0]
        moves += [Move("place", scan, 2, _TURN)] if spread.heading > 0 else []
    return [*moves, Move("offset", 0, 0, _LENGTH)] if evidence.offset_spread > 0 else moves
