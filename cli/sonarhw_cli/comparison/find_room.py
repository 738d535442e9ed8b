"""The room that `sonarhw map` finds from scans, and where to scan next, for the outputs of the command."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sonarhw_compare.scans import in_degrees

from sonarhw.errors import counted

if TYPE_CHECKING:
    from sonarhw_compare.fit import PlacedScan
    from sonarhw_compare.locate import Pose, PoseSpread
    from sonarhw_compare.rooms.outcome import NextPlace
    from sonarhw_compare.rooms.search import FoundRoom, PlacedRoom
    from sonarhw_compare.scans import GivenScan
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.room.room import Room


@dataclass(frozen=True)
class RoomOfScans:
    """A found room, the poses of the scans in it, and where to scan next."""

    placed: "PlacedRoom"
    room: "Room"  # of its file
    board: "Board"  # with range offset and threshold as found
    given_board: "Board"
    next_places: "tuple[NextPlace, ...] | None"  # best first; None: not wanted

    @property
    def found(self) -> "FoundRoom":
        """The walls and posts, with their uncertainties."""
        return self.placed.found

    @property
    def scans(self) -> "tuple[PlacedScan, ...]":
        """The scans at their refined places, without those that could not be located."""
        return self.placed.scans

    @property
    def lines(self) -> list[str]:
        """What was found, as lines to print."""
        from sonarhw_compare.rooms.outcome import assumptions, open_ends, pose_text

        found = self.found
        return [
            *(f"{title}: {'; '.join(map(pose_text, poses))}" for title, poses in self.placed.poses.items()),
            f"found room: {counted(len(found.draft.walls), 'wall')}, {counted(len(found.draft.posts), 'post')}, "
            f"{counted(len(open_ends(found)), 'open end')}; "
            f"{found.explained} of {found.echoes} echoes are within 5 cm of one that it predicts",
            *assumptions(found, self.given_board),
            *map(_next_text, self.next_places or ()),
        ]

    @property
    def figures(self) -> dict[str, Any]:
        """What was found, as figures for JSON."""
        from sonarhw_compare.rooms.outcome import found_room_figures

        poses = {title: list(map(_pose_figures, several)) for title, several in self.placed.poses.items()}
        figures = found_room_figures(self.found) | {"poses": poses, "left_out": list(self.placed.left_out)}
        if self.next_places is not None:
            figures["next"] = list(map(_next_figures, self.next_places))
        return figures


def room_of_scans(
    scans: "Sequence[PlacedScan]",
    board: "Board",
    given: "Sequence[GivenScan]",
    spreads: "Sequence[PoseSpread]",
    plan_next: bool,
    show: Callable[[float, str], None],
) -> RoomOfScans:
    """Return the room that scans show, with the places to scan next if wanted. `show` receives share and step."""
    from sonarhw_compare.rooms.evidence import as_found
    from sonarhw_compare.rooms.outcome import found_room, next_places
    from sonarhw_compare.rooms.search import find_room_and_poses
    from sonarhw_sim.air import Air

    recorded = given[0].recorded_room
    air = Air() if recorded is None else recorded.air
    placed = find_room_and_poses(scans, board, air, spreads, lambda share: show(share, "finding the room"))
    room, board_as_found = found_room(placed, board), as_found(board, placed.found.draft)
    nexts = None
    if plan_next:
        nexts = next_places(
            placed.found, room, board_as_found, tick=lambda share: show(share, "planning the next scan")
        )
    return RoomOfScans(placed, room, board_as_found, board, nexts)


def rounded_point(point: tuple[float, float]) -> list[float]:
    """Return x and y rounded to µm."""
    return [round(at, 6) + 0.0 for at in point]


def _next_text(one: "NextPlace") -> str:
    x, y = one.position
    sectors = ", ".join(f"{in_degrees(first, 0):.0f}° to {in_degrees(last, 0):.0f}°" for first, last in one.sectors)
    return f"scan next at {x:.2f}, {y:.2f} m: {one.gain:.1f} nats; most from headings {sectors or 'none'}"


def _next_figures(one: "NextPlace") -> dict[str, object]:
    return {
        "position_m": rounded_point(one.position),
        "gain_nats": round(one.gain, 3),
        "headings_deg": [[in_degrees(end, 3) for end in ends] for ends in one.sectors],
    }


def _pose_figures(pose: "Pose") -> dict[str, float]:
    x, y = rounded_point(pose.position)
    return {"x_m": x, "y_m": y, "heading_deg": in_degrees(pose.heading, 3), "probability": round(pose.probability, 6)}
