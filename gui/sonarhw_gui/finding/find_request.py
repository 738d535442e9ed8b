"""The search for the room, and for the next place to scan, as requests to a thread."""

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.room import Place, Room

from sonarhw.errors import Cancelled, InputError
from sonarhw.readings import Reading
from sonarhw_gui.work.run_progress import RunProgress

if TYPE_CHECKING:
    from sonarhw_compare.fit.likelihood import ReadingNoise
    from sonarhw_compare.fit.result import PlacedScan
    from sonarhw_compare.locate import Pose, PoseSpread
    from sonarhw_compare.rooms.candidates import Support
    from sonarhw_compare.rooms.draft import DraftPost, DraftWall, RoomDraft
    from sonarhw_compare.rooms.outcome import NextPlace
    from sonarhw_compare.rooms.search import FoundRoom

_MOST_NEXT = 3  # places


@dataclass(frozen=True)
class Accuracy:
    """How well the places of scans are known: standard deviations, infinite for what is unknown but of the first."""

    text: str
    xy: float  # m
    heading: float  # rad


ACCURACIES = (
    Accuracy("exact", 0.0, 0.0),
    Accuracy("within 3 cm and 2°", 0.03, math.radians(2.0)),
    Accuracy("only headings, within 5°", math.inf, math.radians(5.0)),
    Accuracy("unknown but for the first", math.inf, math.inf),
)


@dataclass(frozen=True, eq=False)
class LoadedScan:
    """A scan of the window, with a name that no other one has."""

    name: str
    readings: tuple[Reading, ...]
    place: Place
    board: Board
    known: bool  # whether its log states the place


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """Walls and posts found so far, each with the readings that speak for and against it."""

    draft: "RoomDraft"
    scans: tuple[LoadedScan, ...]  # those at the places of the draft
    board: Board
    supports: "tuple[Support, ...]"  # of its walls, then of its posts

    @property
    def shapes(self) -> "tuple[DraftWall | DraftPost, ...]":
        """The walls, with free ends, and posts, in the order of `supports`."""
        return (*map(self.draft.alone, self.draft.walls), *self.draft.posts)

    def without(self, row: int) -> "Hypotheses":
        """Return all but one wall or post."""
        walls = list(self.draft.walls)
        if row < len(walls):
            draft = self.draft.without_only(walls[row])
        else:
            posts = self.draft.posts
            number = row - len(walls)
            draft = replace(self.draft, posts=posts[:number] + posts[number + 1 :])
        return replace(self, draft=draft, supports=self.supports[:row] + self.supports[row + 1 :])


class FindProgress(RunProgress):
    """Progress of a search, its newest hypotheses, and its cancellation; shared by the thread and its caller."""

    def __init__(self) -> None:
        super().__init__()
        self.newest: Hypotheses | None = None
        self.places: tuple[NextPlace, ...] = ()  # the best ones to scan next so far, best first

    def tick(self, share: float) -> None:
        """Store the share that is done. Raises Cancelled."""
        self.report(share)
        if self.cancelled:
            raise Cancelled("the search was cancelled")

    def take_places(self, places: "tuple[NextPlace, ...]") -> None:
        """Store the best places so far."""
        self.places = places


@dataclass(frozen=True, eq=False)
class RoomAnswer:
    """The room that a search has found."""

    request: "FindRequest"
    hypotheses: Hypotheses
    found: "FoundRoom"
    room: Room  # with the places of the scans
    deviations: dict[tuple[str, int, int], float]  # m or rad, by `what`, `which`, `part` of a `Move`
    poses: "dict[str, tuple[Pose, ...]]"  # possible ones of the scans that were located, by their names
    left_out: tuple[str, ...]  # scans that could not be located


@dataclass(frozen=True)
class FindRequest:
    """Find the room that scans show."""

    scans: tuple[LoadedScan, ...]  # the place of the first one is known
    air: Air
    accuracy: Accuracy
    start: "RoomDraft | None"  # walls and posts that stay
    refused: "tuple[DraftWall | DraftPost, ...]"  # not found again
    progress: FindProgress = field(compare=False)

    def answer(self) -> RoomAnswer:
        """Run the search, which takes seconds to minutes. Raises InputError, Cancelled."""
        from sonarhw_compare.rooms.evidence import FINE, Course
        from sonarhw_compare.rooms.outcome import found_room
        from sonarhw_compare.rooms.search import find_room_and_poses

        board = _one_board(self.scans)
        if self.start is not None and not self.start.is_sound:
            raise InputError("a wall of the room is shorter than 2 cm; remove it in the plan, and go on")
        course = Course(self.start, self.refused, self._accept)
        placed = find_room_and_poses(
            [self._placed(scan) for scan in self.scans], board, self.air, self._spreads(), self.progress.tick, course
        )
        found = placed.found
        return RoomAnswer(
            self,
            self._supported(found.draft, FINE),
            found,
            found_room(placed, board),
            {(move.what, move.which, move.part): deviation for move, deviation in found.deviations.items()},
            placed.poses,
            placed.left_out,
        )

    def _accept(self, draft: "RoomDraft") -> None:
        """Show an accepted draft."""
        from sonarhw_compare.rooms.evidence import ROUGH

        self.progress.newest = self._supported(draft, ROUGH)

    def _supported(self, draft: "RoomDraft", noise: "ReadingNoise") -> Hypotheses:
        from sonarhw_compare.locate import PoseSpread
        from sonarhw_compare.rooms.candidates import support_of
        from sonarhw_compare.rooms.evidence import evidence_of

        by_name = {scan.name: scan for scan in self.scans}
        scans = tuple(by_name[place.name] for place in draft.places)
        placed = [replace(self._placed(scan), place=at) for scan, at in zip(scans, draft.places, strict=True)]
        board = scans[0].board
        evidence = evidence_of(placed, [PoseSpread()] * len(placed), board, self.air)
        return Hypotheses(draft, scans, board, support_of(evidence, draft, noise))

    def _placed(self, scan: LoadedScan) -> "PlacedScan":
        from sonarhw_compare.fit.result import PlacedScan

        return PlacedScan(scan.readings, replace(scan.place, name=scan.name), scan.name)

    def _spreads(self) -> "list[PoseSpread]":
        from sonarhw_compare.locate import UNKNOWN, PoseSpread

        spread = PoseSpread(self.accuracy.xy, self.accuracy.heading)
        first = spread if spread.is_whole else PoseSpread()
        return [first, *(spread if scan.known else UNKNOWN for scan in self.scans[1:])]


@dataclass(frozen=True, eq=False)
class NextAnswer:
    """The best places for another scan, best first."""

    request: "NextRequest"
    places: "tuple[NextPlace, ...]"


@dataclass(frozen=True)
class NextRequest:
    """Find from where another scan makes a found room most certain."""

    answered: RoomAnswer
    progress: FindProgress = field(compare=False)

    def answer(self) -> NextAnswer:
        """Try places in the room. Raises InputError, Cancelled."""
        from sonarhw_compare.rooms.outcome import next_places

        found, room, board = self.answered.found, self.answered.room, self.answered.hypotheses.board
        progress = self.progress
        places = next_places(found, room, board, _MOST_NEXT, progress.tick, progress.take_places)
        return NextAnswer(self, places)


def _one_board(scans: tuple[LoadedScan, ...]) -> Board:
    """Return the board of scans. Raises InputError if they have several."""
    for scan in scans[1:]:
        if scan.board.name != scans[0].board.name:
            raise InputError(
                f"{scans[0].name} is of board {scans[0].board.name!r}, {scan.name} of {scan.board.name!r}; hide the "
                "scans of one of them in the panel Scans"
            )
    return scans[0].board
