"""The room and the poses of scans of which only some poses are known: simultaneous localisation and mapping.

The scans with known poses give a first room, in which the others are located. Those that it explains well are placed at
once. If there are none, the one that it explains best is placed at each of its possible poses in turn: each gives
another room, and the one that explains all scans best is kept, if it is worth more than the room without this scan and
a room of this scan alone. One scan in a part of a room often has several poses that are almost as probable, but the
walls that it then needs contradict the other scans at the wrong ones. If no scan can be placed so, improbable poses are
tried, too: while the walls about a scan are missing, its right pose can be one of them.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.room import Place

from sonarhw.errors import InputError
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.locate.pose_spread import PoseSpread
from sonarhw_compare.locate.poses import Located, Pose, locate_scan
from sonarhw_compare.processes.late_processes import LateProcesses
from sonarhw_compare.room_finding.evidence import FOLLOWED, REFLECTANCE, Course, as_found
from sonarhw_compare.room_finding.room_search import LARGE, FoundRoom, find_room, worth_alone
from sonarhw_compare.search_progress import SearchProgress

# m, rad: of what is unknown of the pose of a located scan; wide, because the scan itself gives it
_LOCATED = PoseSpread(0.05, 0.06)
_WIDTHS = (_LOCATED.xy, _LOCATED.xy, _LOCATED.heading)
_AS_GOOD = 0.9  # of the share that the room explains of its own scans, at which a scan is placed at once
_PROBABLE = 0.8  # least probability of a pose at which its scan is placed at once
_TRIED = 3  # poses of a scan, each of which needs a room
_LOCATING, _TRYING = 0.02, 0.25  # of what is left of a part of the progress, for a scan and for a room or a scan alone
_NARROW = PoseSpread(0.1, math.radians(6))  # up to this spread, a scan is placed where it is given, else it is located
_UNLIKELY = 0.05  # probability of a pose, by that of the most probable one, below which it is not tried


@dataclass(frozen=True)
class PlacedRoom:
    """A room found from scans, and the poses found with it."""

    found: FoundRoom
    scans: tuple[PlacedScan, ...]  # those of the room, at their refined places
    # possible poses of each located scan, by its title, in the room of the scans before it
    poses: dict[str, tuple[Pose, ...]]
    left_out: tuple[str, ...]  # titles of the scans that could not be located


@dataclass(frozen=True)
class _Stage:
    """A room of some scans at the places with which its search began."""

    placed: dict[int, PlacedScan]  # by number, in order
    found: FoundRoom

    @cached_property
    def refined(self) -> dict[int, PlacedScan]:
        """The scans at their refined places."""
        places = self.found.draft.places
        return {k: replace(scan, place=at) for (k, scan), at in zip(self.placed.items(), places, strict=True)}

    def sensor(self, board: Board) -> Board:
        """Return the board with range offset and threshold as these scans show them, and with what is left of spreads.

        One sensor made all scans, so others are expected to show the same.
        """
        range_sd, threshold_sd = self.found.offset_deviation or 0.0, self.found.threshold_deviation or 0.0
        return replace(as_found(board, self.found.draft), range_sd=range_sd, threshold_sd_db=threshold_sd)

    def explained(self, numbers: Sequence[int]) -> float:
        """Return the share of the echoes of some of the scans that the room explains."""
        touches, rows = self.found.touches, [list(self.placed).index(k) for k in numbers]
        echoes = sum(touches.echoes[row] for row in rows)
        return 1 - sum(touches.unexplained[row] for row in rows) / max(1, echoes)


def find_room_and_poses(
    scans: Sequence[PlacedScan],
    board: Board,
    air: Air,
    spreads: Sequence[PoseSpread] = (),
    tick: Callable[[float], None] = lambda _share: None,
    course: Course | None = None,
) -> PlacedRoom:
    """Return the room and the poses that explain scans.

    `spreads` are the standard deviations of the places of the scans, by default exact; positions, headings or both may
    be unknown. Scans known within 10 cm and 6° give the first room; if there are none, the first one with a whole pose
    gives it. `tick` receives the completed share, 0..1; `course` continues a search. Raises InputError as `find_room`
    does, and if no whole pose is known.
    """
    spreads = spreads or [PoseSpread()] * len(scans)
    with LateProcesses(len(scans), LARGE) as processes:
        search = _Search(tuple(scans), tuple(spreads), board, air, SearchProgress(tick), course or Course(), processes)
        if not search.known:
            raise InputError("no pose is known; give that of the first log")
        search.progress.begin(1 / search.parts)
        stage = search.room_of(search.known, 1.0, search.course)
        poses: dict[int, tuple[Pose, ...]] = {}
        while len(stage.placed) < len(scans):
            search.progress.begin((len(stage.placed) - len(search.known) + 2) / search.parts)
            located = search.located(stage)
            longer = search.extended(stage, located)
            if longer is None:
                longer = search.extended_elsewhere(stage, located)
                if longer is None:
                    break
                located = search.located(longer, longer.placed.keys() - stage.placed.keys())
            poses |= {k: located[k].poses for k in longer.placed.keys() - stage.placed.keys()}
            stage = longer
        if poses:  # once more, because the last scans began at located places, which are not refined
            search.progress.begin(1.0)
            again = search.room_with(stage, {}, 1.0, search.course.unseen)
            stage = max(again, stage, key=lambda one: one.found.worth)
    tick(1.0)
    return PlacedRoom(
        stage.found,
        tuple(stage.refined.values()),
        {scans[k].title: found_here for k, found_here in sorted(poses.items())},
        tuple(scan.title for k, scan in enumerate(scans) if k not in stage.placed),
    )


@dataclass(frozen=True)
class _Search:
    """The scans, how well their poses are known, and what the search for a room needs."""

    scans: tuple[PlacedScan, ...]
    spreads: tuple[PoseSpread, ...]  # of their places
    board: Board
    air: Air
    progress: SearchProgress
    course: Course
    processes: LateProcesses
    # worth of the walls that one scan of a sensor needs by itself
    alone: dict[tuple[int, Board], float] = field(default_factory=dict)

    @cached_property
    def known(self) -> dict[int, PlacedScan]:
        """The scans of which the pose is known well, by number; if there are none, the first with a whole pose."""
        whole = {k: scan for k, scan in enumerate(self.scans) if self.spreads[k].is_whole}
        return {k: scan for k, scan in whole.items() if self._is_narrow(k)} or dict(list(whole.items())[:1])

    def _is_narrow(self, k: int) -> bool:
        return self.spreads[k].xy <= _NARROW.xy and self.spreads[k].heading <= _NARROW.heading

    @property
    def parts(self) -> int:
        """The number of parts of the progress: the first room, each scan of unknown pose, and the room of all."""
        unknown = len(self.scans) - len(self.known)
        return unknown + 2 if unknown else 1

    def room_of(self, placed: dict[int, PlacedScan], part: float, course: Course) -> _Stage:
        """Return the room of some scans; it takes a `part` of what is left of the part of the progress."""
        spreads = [self._spread(k, scan.place) for k, scan in placed.items()]
        tick = self.progress.inner(part)
        found = find_room(list(placed.values()), self.board, self.air, spreads, tick, course, self.processes)
        return _Stage(placed, found)

    def _spread(self, k: int, begins: Place) -> PoseSpread:
        """Return the spread of the pose of a scan: what is known of it, and for the rest that of a located scan."""
        if k in self.known:
            return self.spreads[k]
        given, spread = self.scans[k].place, self.spreads[k].with_width
        has_position, has_heading = math.isfinite(spread.xy), math.isfinite(spread.heading)
        return PoseSpread(
            spread.xy if has_position else _LOCATED.xy,
            spread.heading if has_heading else _LOCATED.heading,
            replace(
                begins,
                position=given.position if has_position else begins.position,
                heading=given.heading if has_heading else begins.heading,
            ),
        )

    def located(self, stage: _Stage, numbers: Iterable[int] | None = None) -> dict[int, Located]:
        """Return the possible poses in a room of these scans, by default of all that are not placed."""
        room, sensor = stage.found.draft.room(REFLECTANCE, self.air), stage.sensor(self.board)
        return {
            k: locate_scan(
                scan.readings,
                room,
                sensor,
                prediction=FOLLOWED,
                expected=scan.place,
                spread=self.spreads[k],
                tick=self.progress.inner(_LOCATING),
            )
            for k, scan in enumerate(self.scans)
            if (k not in stage.placed if numbers is None else k in numbers)
        }

    def extended(self, stage: _Stage, located: Mapping[int, Located]) -> _Stage | None:
        """Return the room of one more scan, or of all that are sure; None if none of them can be placed."""
        own = stage.explained(list(stage.placed))
        sure = [
            k for k, one in located.items() if one.explained >= _AS_GOOD * own and one.poses[0].probability >= _PROBABLE
        ]
        if sure:
            return self.room_with(stage, {k: located[k].poses[0] for k in sure}, 1.0, self.course)
        return self._with_first(stage, {k: _probable(located[k].poses) for k in _best_explained(located)})

    def extended_elsewhere(self, stage: _Stage, located: Mapping[int, Located]) -> _Stage | None:
        """Return the room of one more scan at a pose that is improbable in the room without it; None if there is none.

        A room that lacks the walls of the scan can explain more of it at a wrong pose than at the right one.
        """
        peaks = {
            k: [Pose((x, y), heading, 0.0, 0.0, _WIDTHS) for x, y, heading in located[k].peaks]
            for k in _best_explained(located)
        }
        return self._with_first(stage, peaks)

    def _with_first(self, stage: _Stage, poses: Mapping[int, Sequence[Pose]]) -> _Stage | None:
        """Return the best room with the first scan that shares walls with the others at one of its poses, or None."""
        for k, tried in poses.items():
            rooms = [self.room_with(stage, {k: pose}, _TRYING, self.course.unseen) for pose in tried]
            longer = max(rooms, key=lambda one: one.found.worth)
            if longer.found.worth >= stage.found.worth + self._alone(k, stage):  # else they share no walls at this pose
                self.course.accept(longer.found.draft)
                return longer
        return None

    def _alone(self, k: int, stage: _Stage) -> float:
        """Return the worth of the walls that explain one scan by itself, made by the sensor of the other scans."""
        sensor = stage.sensor(self.board)
        if (k, sensor) not in self.alone:
            self.alone[k, sensor] = worth_alone(self.scans[k], sensor, self.air, self.progress.inner(_TRYING))
        return self.alone[k, sensor]

    def room_with(self, stage: _Stage, poses: Mapping[int, Pose], part: float, course: Course) -> _Stage:
        """Return the room with more scans at their poses; scans of known poses begin where they are given.

        It is also searched from the room of the stage, because a search from nothing can miss a better one.
        """
        before = stage.refined | self.known
        more = {
            k: replace(self.scans[k], place=replace(self.scans[k].place, position=pose.position, heading=pose.heading))
            for k, pose in poses.items()
        }
        placed = dict(sorted((before | more).items()))
        refined = stage.refined | more
        likely = replace(stage.found.draft, places=tuple(refined[k].place for k in placed))
        return self.room_of(placed, part, replace(course, likely=likely))


def _best_explained(located: Mapping[int, Located]) -> list[int]:
    """Return the numbers of scans, first those of which the room explains most."""
    return sorted(located, key=lambda k: -located[k].explained)


def _probable(poses: Sequence[Pose]) -> list[Pose]:
    """Return the poses of a scan that are tried first."""
    return [pose for pose in poses[:_TRIED] if pose.probability >= _UNLIKELY * poses[0].probability]
