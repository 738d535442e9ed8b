"""The long searches of the window: the pose of the scanner, causes of misfits, the room. Each is one job at a time."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import tomlkit
from PySide6.QtCore import QObject, Signal, Slot
from sonarhw_compare.edits import remove_surface
from sonarhw_compare.match import compare_readings
from sonarhw_compare.rooms.effort import Effort
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import Board, without_own_body
from sonarhw_sim.room.room import Place, Room

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray, Reading
from sonarhw_gui.jobs.jobs import BackgroundJob, Jobs
from sonarhw_gui.model.edits import Edit, room_and_place, with_sensor_at
from sonarhw_gui.model.look import LengthUnit
from sonarhw_gui.model.scene import NOWHERE, Scene, room_name
from sonarhw_gui.model.shown import OverlaidScan, Shown

if TYPE_CHECKING:
    from sonarhw_compare.fit import (
        Estimate,
        FitResult,
        Parameter,  # importing it takes half a second
        PlacedScan,
    )
    from sonarhw_compare.fit.likelihood import ReadingNoise
    from sonarhw_compare.fit.result import FitWarning
    from sonarhw_compare.locate import OtherReading, PoseSpread
    from sonarhw_compare.rooms.candidates import Support
    from sonarhw_compare.rooms.causes import FoundCauses
    from sonarhw_compare.rooms.draft import DraftPost, DraftWall, RoomDraft
    from sonarhw_compare.rooms.outcome import NextPlace
    from sonarhw_compare.rooms.search import FoundRoom
    from sonarhw_compare.track import ScanTracker


@dataclass(frozen=True)
class SearchState:
    """State of a search: none, running, or finished."""

    running: bool = False
    share: float = 0.0
    step: str = ""
    answer: Any = None


class Search(QObject):
    """Starts, observes and cancels a search. `state` is a frozen value; subclasses may use another one."""

    changed = Signal(object)  # the new state
    failed = Signal(str)

    def __init__(
        self, key: str, function: Callable[..., Any], shown: Callable[[], Shown], jobs: Jobs, parent: QObject
    ) -> None:
        """`function` gets what the window shows, the settings of `start`, and its `BackgroundJob`."""
        super().__init__(parent)
        self.state: Any = SearchState()
        self._key, self._function, self._shown, self._jobs = key, function, shown, jobs

    @Slot()
    @Slot(object)
    def start(self, *settings: object) -> None:
        """Search in what the window shows; a running search is cancelled."""
        self._run(self._function, self._shown(), *settings)
        self._set_state(SearchState(running=True))

    @Slot()
    def cancel(self) -> None:
        """Cancel a search; without one, discard the result."""
        self._jobs.cancel(self._key)
        self._set_state(self._idle())

    def _run(self, function: Callable[..., Any], *args: object) -> None:
        self._jobs.cancel(self._key)
        self._jobs.run(self._key, function, *args, then=self._finish, failed=self._fail, progress=self._observe)

    def _observe(self, job: BackgroundJob) -> None:
        self._set_state(self._running(job))

    def _finish(self, answer: Any) -> None:
        self._set_state(self._finished(answer))

    def _fail(self, message: str) -> None:
        self._set_state(self._idle())
        if message:
            self.failed.emit(message)

    def _set_state(self, state: Any) -> None:
        if state != self.state:
            self.state = state
            self.changed.emit(state)

    # for subclasses

    def _idle(self) -> Any:
        """Return the state after a search that was cancelled or has failed."""
        return SearchState()

    def _running(self, job: BackgroundJob) -> Any:
        """Return the state during a search."""
        return SearchState(running=True, share=job.share, step=job.step)

    def _finished(self, answer: Any) -> Any:
        """Return the state after a complete search."""
        return SearchState(answer=answer)


FITTED = "finding the pose"  # label of Undo
_DIGITS = 4  # of lengths in m
_DIGITS_DEG = 2

_X, _Y, _HEADING = "x", "y", "heading"


def fitted(scene: Scene, values: "Mapping[Parameter, float]", board: Board) -> Edit:
    """Return the scene with the fitted values; offsets are relative to `board`, the board of the fit.

    Raises InputError if the room cannot have these values.
    """
    from sonarhw_compare.fit.fitting import fitted_room

    room, _ = room_and_place(scene)
    changed = replace(scene, room=fitted_room(room, values, ()), board=_board(scene.board, board, values))
    return _at_fitted_place(changed, {parameter.quantity.name: value for parameter, value in values.items()}), FITTED


def _at_fitted_place(scene: Scene, values: Mapping[str, float]) -> Scene:
    _, place = room_and_place(scene)
    if not values.keys() & {_X, _Y, _HEADING}:
        return scene
    x, y = (round(values.get(kind, before), _DIGITS) for kind, before in zip((_X, _Y), place.position, strict=True))
    degrees = round(math.degrees(values.get(_HEADING, place.heading)), _DIGITS_DEG)
    return with_sensor_at(scene, (x, y), math.radians(degrees % 360))


def _board(board: Board, fitted_with: Board, values: "Mapping[Parameter, float]") -> Board:
    from sonarhw_compare.fit.fitting import board_values, table_and_key

    profile: Any = tomlkit.parse(board.text)
    for _, quantity, value in board_values(fitted_with, values):
        table, key = table_and_key(profile, quantity)
        table[key] = value
        board = quantity.write(board, value)
    return replace(board, text=tomlkit.dumps(profile))


@dataclass(frozen=True, eq=False)
class FitFound:
    """The result of a fit."""

    scene: Scene  # of the fit
    readings: int
    everywhere: bool  # whether the whole room was searched
    result: "FitResult"
    solutions: "tuple[Mapping[Parameter, float], ...]"  # the best first
    within_5cm: float | None  # share of the echoes, before the fit
    fitted_within_5cm: tuple[float | None, ...]  # likewise, with each solution
    otherwise: "OtherReading | None" = None  # the scan with clockwise angles or in another unit, which explains it


def find_pose(shown: Shown, free: tuple[str, ...], everywhere: bool, job: BackgroundJob) -> FitFound:
    """Fit to the newest readings shown, which takes about ten seconds. Raises InputError, Cancelled.

    `free`: words of the free quantities. `everywhere`: search the whole room, not only beside the place shown.
    """
    from sonarhw_compare.one_call import fit  # takes half a second
    from sonarhw_compare.scans import GivenScan

    scene, readings = shown.scene, shown.readings[-_MOST_READINGS:]
    room, place = room_and_place(scene)
    result = fit(
        GivenScan("this scan", readings, pose=place),
        room,
        None if everywhere else place,
        scene.board,
        free=free,
        options=scene.options,
        progress=job.report,
        warn=_ignored,
    )
    solutions = tuple(_values(result))
    after = tuple(_within_5cm(readings, fitted(scene, values, scene.board)[0]) for values in solutions)
    before, otherwise = _within_5cm(readings, scene), None
    if everywhere and any(warning.kind == "few explained" for warning in result.warnings):
        otherwise = _read_otherwise(readings, scene, job)
    return FitFound(scene, len(readings), everywhere, result, solutions, before, after, otherwise)


def _read_otherwise(readings: tuple[Reading, ...], scene: Scene, job: BackgroundJob) -> "OtherReading | None":
    """Return the way to read a scan that explains it better than as it was read, if there is one."""
    from sonarhw_compare.one_call import locate
    from sonarhw_compare.scans import GivenScan

    located = locate(
        GivenScan("this scan", readings),
        scene.room,
        scene.board,
        receiver=scene.options.receiver,
        progress=lambda share: job.report(share, "reading it otherwise"),
        warn=_ignored,
    )
    return located.better_read


def _ignored(_doubt: str) -> None:
    """Ignore a doubt about the scene, which the window shows already."""


def _within_5cm(readings: tuple[Reading, ...], scene: Scene) -> float | None:
    room, _ = room_and_place(scene)
    return compare_readings(readings, room, scene.pose, scene.board, scene.options).summary().within_5cm


def _values(result: "FitResult") -> "list[Mapping[Parameter, float]]":
    """Return the values of every solution. The best one has the estimates, which are more accurate than its peak."""
    best = {parameter: result.estimates[parameter.name].value for parameter in result.parameters}
    return [
        best,
        *({parameter: mode.values[parameter.name] for parameter in result.parameters} for mode in result.modes[1:]),
    ]


_MOST_READINGS = 720  # the newest ones; more readings of one place do not improve the fit


def rows(fit: FitFound, solution: int, unit: LengthUnit) -> list[tuple[str, str, str]]:
    """Return name, value and standard deviation in the same unit. Only the best solution has deviations."""
    values, estimates = fit.solutions[solution], fit.result.estimates
    if solution > 0:
        return [(_name(parameter), value_text(parameter, value, unit), "") for parameter, value in values.items()]
    lines = []
    for parameter, value in values.items():
        estimate = estimates[parameter.name]
        rounded = _as_known(parameter, value, estimate, unit)
        lines.append((_name(parameter), rounded, _deviation(parameter, estimate, unit)))
    return lines


def share_line(fit: FitFound, solution: int) -> str:
    """Return the shares of echoes within 5 cm before the fit and with this solution."""
    before, after = (_percent(share) for share in (fit.within_5cm, fit.fitted_within_5cm[solution]))
    return f"within 5 cm: {before} before, {after} after"


def solution_line(fit: FitFound, solution: int, unit: LengthUnit) -> str:
    """Return the pose of a solution in one line."""
    values = fit.solutions[solution].items()
    pose = {parameter.quantity.name: value_text(parameter, value, unit) for parameter, value in values}
    place = ", ".join(pose[name] for name in ("x", "y", "heading") if name in pose)
    return f"{solution + 1}: {place or 'same pose'}"


def warnings(fit: FitFound) -> list[str]:
    """Return what the scan cannot determine, and whether the fit matches worse than before."""
    if fit.otherwise is not None:
        shares = f"{fit.otherwise.explained:.0%} instead of {_percent(fit.fitted_within_5cm[0])}"
        return [f"probably read wrongly: {fit.otherwise.correction.name}, {shares} of the echoes are explained"]
    texts = [_warning_text(warning, fit.everywhere) for warning in fit.result.warnings]
    before, after = fit.within_5cm, fit.fitted_within_5cm[0]
    if before is not None and after is not None and after < before:
        texts.append("fewer echoes match than before: the room differs from its file in something else")
    return texts


def _warning_text(warning: "FitWarning", everywhere: bool) -> str:
    """Return a warning in the words of the window: its list has the solutions, and no command is named."""
    if warning.kind == "several solutions":
        return "several poses explain the scan about equally well, the room may be symmetric; try each above"
    if warning.kind == "few explained" and warning.share is not None:
        elsewhere = "" if everywhere else ", or search in the whole room"
        return f"only {_percent(warning.share)} of the echoes are within 5 cm; check the room and the board{elsewhere}"
    return warning.text


def _name(parameter: "Parameter") -> str:
    return f"{parameter.quantity.label} {parameter.of}".strip()


def value_text(parameter: "Parameter", value: float, unit: LengthUnit) -> str:
    """Return the text of a value with its unit."""
    match parameter.quantity.unit:
        case "°":
            return _signed(f"{math.degrees(value):z.2f}°")
        case "m" if parameter.quantity.word == "position":
            return _signed(unit.text(value))
        case "m":
            small = unit.small
            return _signed(f"{value * small.per_metre:+z.{small.decimals + 1}f} {small.label}")
        case "":
            return f"{value:.3f}"
        case printed:
            return _signed(f"{value:z.1f} {printed}")


def _as_known(parameter: "Parameter", value: float, estimate: "Estimate", unit: LengthUnit) -> str:
    """Return a value with as many digits as its deviation justifies; a position in the unit of its deviation."""
    if parameter.quantity.word != "position":
        return value_text(parameter, value, unit)
    small = unit.small
    decimals = min(2, _decimals(estimate.deviation * small.per_metre))
    return _signed(f"{value * small.per_metre:z.{decimals}f} {small.label}")


def _deviation(parameter: "Parameter", estimate: "Estimate", unit: LengthUnit) -> str:
    match parameter.quantity.unit:
        case "°":
            return f"± {_two_figures(math.degrees(estimate.deviation))}°"
        case "m":
            small = unit.small
            return f"± {_two_figures(estimate.deviation * small.per_metre)} {small.label}"
        case printed:
            return f"± {_two_figures(estimate.deviation)} {printed}".rstrip()


def _signed(text: str) -> str:
    return text.replace("-", "−")


def _two_figures(deviation: float) -> str:
    if not math.isfinite(deviation):
        return "?"
    return f"{deviation:.{min(_decimals(deviation), 4)}f}"


def _decimals(deviation: float) -> int:
    """Return the number of decimals for two significant digits."""
    return max(0, 1 - math.floor(math.log10(deviation))) if deviation > 0 and math.isfinite(deviation) else 0


def _percent(share: float | None) -> str:
    return "no echo" if share is None else f"{share:.0%}"


_MOST_READINGS_OF_CAUSES = 360  # the newest ones; the time of a search is proportional to their number


@dataclass(frozen=True, eq=False)
class CausesAnswer:
    """The result of a search for causes."""

    scene: Scene
    first: int  # number of the first reading that was searched among those shown
    result: "FoundCauses"


def search_causes(shown: Shown, job: BackgroundJob) -> CausesAnswer:
    """Search for changes of the room that explain misfits of the newest readings shown, for about ten seconds.

    Raises InputError.
    """
    from sonarhw_compare.one_call import compare, find_missing  # takes half a second

    newest, scene = shown.readings[-_MOST_READINGS_OF_CAUSES:], shown.scene
    room, place = room_and_place(scene)
    comparison = compare(newest, room, place, scene.board, receiver=scene.options.receiver, warn=_ignored)
    result = find_missing(comparison, lambda share: job.report(share, "searching"))
    return CausesAnswer(scene, len(shown.readings) - len(newest), result)


class Tracking(Search):
    """Tracks a robot, and goes on while its log grows. One job runs at a time; what is recorded meanwhile waits."""

    def __init__(self, shown: Callable[[], Shown], jobs: Jobs, parent: QObject) -> None:
        super().__init__("track", track_robot, shown, jobs, parent)
        self._tracker: ScanTracker | None = None
        self._recorded: tuple[Reading, ...] = ()  # of a log that grows
        self._whole = True

    @Slot()
    def cancel(self) -> None:
        """Cancel a search; without one, discard the result."""
        self._tracker, self._recorded = None, ()
        super().cancel()

    def follow(self, recorded: tuple[Reading, ...], whole: bool) -> None:
        """Follow the robot through the readings that a log has now; `whole`: it grows no more."""
        placed = len(recorded)
        while placed and recorded[placed - 1].pose is None:
            placed -= 1  # its pose is not written yet
        self._recorded, self._whole = recorded[:placed], whole
        self._go_on()

    def _go_on(self) -> None:
        tracker = self._tracker
        if tracker is None or self.state.running or self._jobs.busy(self._key):
            return
        further = self._recorded[tracker.readings :]
        if further or (self._whole and tracker.waits):
            self._jobs.run(
                self._key, track_further, tracker, further, self._whole, then=self._finish, failed=self._fail
            )

    def _finish(self, answer: "ScanTracker") -> None:
        self._tracker = answer
        super()._finish(answer)
        self._go_on()

    def _fail(self, message: str) -> None:
        self._tracker = None
        super()._fail(message)

    def _finished(self, answer: "ScanTracker") -> SearchState:
        return SearchState(answer=answer.track())


def track_robot(shown: Shown, everywhere: bool, job: BackgroundJob) -> "ScanTracker":
    """Follow the robot through the readings shown, from its first pose or from anywhere, by their odometry.

    Raises InputError if the readings have no poses.
    """
    from sonarhw_compare.track import ScanTracker

    room, _ = room_and_place(shown.scene)
    start = None if everywhere or shown.poses is None else Place("", _xy(shown.poses[0]), float(shown.poses[0, 2]))
    tracker = ScanTracker("this scan", room, shown.scene.board, start)
    tracker.take(shown.readings, progress=lambda share: job.report(share, "tracking"))
    return tracker


def track_further(tracker: "ScanTracker", readings: tuple[Reading, ...], whole: bool) -> "ScanTracker":
    """Follow the robot through further readings."""
    tracker.take(readings, whole=whole)
    return tracker


def _xy(pose: FloatArray) -> tuple[float, float]:
    return float(pose[0]), float(pose[1])


_MOST_NEXT = 3  # places


# how well the places of scans are known: standard deviations of x and y, m, and of the heading, rad; infinite for what
# is unknown but of the first scan
Accuracy: TypeAlias = tuple[float, float]
ACCURACIES: dict[str, Accuracy] = {
    "exact": (0.0, 0.0),
    "within 3 cm and 2°": (0.03, math.radians(2.0)),
    "only positions, within 3 cm": (0.03, math.inf),
    "only headings, within 5°": (math.inf, math.radians(5.0)),
    "unknown but for the first": (math.inf, math.inf),
}


@dataclass(frozen=True, eq=False)
class LoadedScan:
    """A scan of the window, with a name that no other one has."""

    name: str
    readings: tuple[Reading, ...]
    place: Place
    board: Board
    has_place: bool  # whether its log states it


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
            draft = self.draft.without_post(self.draft.posts[row - len(walls)])
        return replace(self, draft=draft, supports=self.supports[:row] + self.supports[row + 1 :])


@dataclass(frozen=True, eq=False)
class RoomAnswer:
    """The room that a search has found."""

    hypotheses: Hypotheses
    result: "FoundRoom"
    room: Room  # with the places of the scans


def search_room(
    scans: tuple[LoadedScan, ...],
    air: Air,
    accuracy: Accuracy,
    effort: Effort,
    start: "RoomDraft | None",
    refused: "tuple[DraftWall | DraftPost, ...]",
    job: BackgroundJob,
) -> RoomAnswer:
    """Find the room that scans show, which takes seconds to minutes; the place of the first one is known.

    Walls and posts of `start` stay, those `refused` are not found again. Raises InputError, Cancelled.
    """
    from sonarhw_compare.rooms.evidence import FINE, ROUGH, Course
    from sonarhw_compare.rooms.outcome import found_room
    from sonarhw_compare.rooms.search import find_room_and_poses

    board = _one_board(scans)
    if start is not None and not start.is_sound:
        raise InputError("a wall of the room is shorter than 2 cm; remove it in the plan, and go on")
    course = Course(start, refused, lambda draft: job.show(_supported(scans, air, draft, ROUGH)), effort=effort)
    result = find_room_and_poses(
        [_placed(scan) for scan in scans], board, air, _spreads(scans, accuracy), job.report, course
    )
    return RoomAnswer(_supported(scans, air, result.draft, FINE), result, found_room(result, board))


def _supported(scans: tuple[LoadedScan, ...], air: Air, draft: "RoomDraft", noise: "ReadingNoise") -> Hypotheses:
    from sonarhw_compare.locate import PoseSpread
    from sonarhw_compare.rooms.candidates import support_of
    from sonarhw_compare.rooms.evidence import evidence_of

    by_name = {scan.name: scan for scan in scans}
    used = tuple(by_name[place.name] for place in draft.places)
    placed = [replace(_placed(scan), place=place) for scan, place in zip(used, draft.places, strict=True)]
    board = used[0].board
    evidence = evidence_of(placed, [PoseSpread()] * len(placed), board, air)
    return Hypotheses(draft, used, board, support_of(evidence, draft, noise))


def _placed(scan: LoadedScan) -> "PlacedScan":
    from sonarhw_compare.fit.result import PlacedScan

    return PlacedScan(scan.readings, replace(scan.place, name=scan.name), scan.name)


def _spreads(scans: tuple[LoadedScan, ...], accuracy: Accuracy) -> "list[PoseSpread]":
    from sonarhw_compare.locate import UNKNOWN, PoseSpread, determine_headings

    spread = PoseSpread(*accuracy)
    others = [spread if scan.has_place else UNKNOWN for scan in scans[1:]]
    first = spread if spread.is_whole or determine_headings([spread, *others]) else PoseSpread()
    return [first, *others]


def plan_next_scan(answer: RoomAnswer, job: BackgroundJob) -> "tuple[NextPlace, ...]":
    """Return the places from which another scan makes a found room most certain, best first.

    Raises InputError, Cancelled.
    """
    from sonarhw_compare.rooms.outcome import next_places

    return next_places(answer.result, answer.room, answer.hypotheses.board, _MOST_NEXT, job.report, job.show)


def _one_board(scans: tuple[LoadedScan, ...]) -> Board:
    """Return the board of scans. Raises InputError if they have several."""
    for scan in scans[1:]:
        if scan.board.name != scans[0].board.name:
            raise InputError(
                f"{scans[0].name} is of board {scans[0].board.name!r}, {scan.name} of {scan.board.name!r}; hide the "
                "scans of one of them in the panel Scans"
            )
    return scans[0].board


MOST_READINGS = 360  # of a scan, the newest ones; the time of a search is proportional to their number


def loaded_scans(shown: Shown, name: str) -> tuple[LoadedScan, ...]:
    """Return the scan shown, which gets `name`, and the visible scans drawn over it. Without readings, it is omitted.

    A scan shown of which the list has a part, such as a sweep, is omitted too.
    """
    listed = [overlay for overlay in shown.overlays if overlay.visible and overlay.readings]
    is_listed = any(share_readings(scan.readings, shown.readings) for scan in listed)
    scans = [] if is_listed or not shown.readings else [_loaded(name, shown.readings, shown.scene)]
    scans += [_loaded(scan.name, scan.readings, scan.scene) for scan in listed]
    first = next((scan for scan in scans if scan.has_place), None)
    ordered = scans if first is None else [first, *(scan for scan in scans if scan is not first)]
    return tuple(_with_own_names(ordered))


def share_readings(readings: tuple[Reading, ...], others: tuple[Reading, ...]) -> bool:
    """Return whether two scans have a common reading, the same object."""
    return not {id(reading) for reading in readings}.isdisjoint(id(reading) for reading in others)


def _loaded(name: str, readings: tuple[Reading, ...], scene: Scene) -> LoadedScan:
    has_place = scene.place is not None
    of_room = tuple(without_own_body(scene.board.own_body, readings))  # as the search counts them
    return LoadedScan(name, of_room[-MOST_READINGS:], scene.place or NOWHERE, scene.board, has_place)


def _with_own_names(scans: Iterable[LoadedScan]) -> Iterable[LoadedScan]:
    """Yield scans, with a number behind a name that another one has already."""
    used: set[str] = set()
    for scan in scans:
        name, number = scan.name or "scan", 2
        while name in used:
            name, number = f"{scan.name or 'scan'} {number}", number + 1
        used.add(name)
        yield replace(scan, name=name)


@dataclass(frozen=True, eq=False)
class FindState:
    """State of the search."""

    running: str = ""  # what runs: "searching" or "planning"; empty: nothing
    share: float = 0.0
    hypotheses: Hypotheses | None = None  # without those rejected
    answer: RoomAnswer | None = None  # of a complete search, also after walls of it were rejected
    refused: "tuple[DraftWall | DraftPost, ...]" = ()
    places: "tuple[NextPlace, ...]" = ()  # to scan next, best first; of those tried so far
    accepted: bool = False  # whether `answer` was made the room of the window
    searched_in: tuple[str, str] = ("", "")  # name and file of the room shown when the search began

    def is_in(self, scene: Scene) -> bool:
        """Return whether the walls belong to the room of a scene: that of the search, or the accepted one."""
        is_accepted = self.answer is not None and self.accepted and room_name(scene) == self.answer.room.name
        return is_accepted or room_of(scene) == self.searched_in

    @property
    def whole(self) -> bool:
        """Whether there is a complete result, of which nothing was rejected."""
        return self.answer is not None and self.hypotheses is self.answer.hypotheses

    @property
    def room(self) -> Room | None:
        """The room that was found, without what was rejected; None without a complete result, or without walls."""
        if self.answer is None or self.hypotheses is None or not self.hypotheses.draft.walls:
            return None
        room, kept = self.answer.room, {support.name for support in self.hypotheses.supports}
        for name in self.answer.room.names:
            if name not in kept:
                room = remove_surface(room, room.names.index(name))
        return room


class RoomSearch(Search):
    """Starts, continues and cancels the search for the room, and plans the next scan."""

    state: FindState
    settled = Signal()  # the scans or the scene of a search that has failed were changed

    def __init__(self, shown: Callable[[], Shown], name: Callable[[], str], jobs: Jobs, parent: QObject) -> None:
        """`shown` returns what the window shows, `name` the name of the scan in it."""
        super().__init__("find the room", search_room, shown, jobs, parent)
        self.state, self._name = FindState(), name
        self._newest: Any = None  # partial result of the running search; `state` has it without what was rejected
        self._searching: tuple[Any, ...] = ()  # scans, air, accuracy and effort of the newest search
        self._failed_with: tuple[Scene, tuple[OverlaidScan, ...]] | None = None

    def tick(self) -> None:
        """Emit whether the cause of a failure may be gone."""
        failed, now = self._failed_with, self._searched
        if failed is not None and any(before is not after for before, after in zip(failed, now, strict=True)):
            self._failed_with = None
            self.settled.emit()

    def _fail(self, message: str) -> None:
        super()._fail(message)
        self._failed_with = self._searched

    @property
    def _searched(self) -> tuple[Scene, tuple[OverlaidScan, ...]]:
        return self._shown().scene, self._shown().overlays

    @Slot(object)
    def start(self, accuracy: Accuracy, effort: Effort = Effort.NORMAL) -> None:
        """Start a search without walls in the loaded scans; a running one is cancelled."""
        if scans := self._scans:
            self._search((scans, self._air, accuracy, effort), None, FindState())

    @Slot(object)
    def go_on(self, accuracy: Accuracy, effort: Effort = Effort.NORMAL) -> None:
        """Continue from the accepted and edited room, or else from the list; rejected walls are not found again."""
        state, scans, room = self.state, self._scans, self._shown().scene.room
        if state.hypotheses is None or not scans:
            return
        refused, answer = state.refused, state.answer
        # edits of a room keep its name
        if state.accepted and answer is not None and room is not None and room.name == answer.room.name:
            from sonarhw_compare.rooms.draft import draft_of_room

            start = draft_of_room(room)
            named = zip(state.hypotheses.shapes, state.hypotheses.supports, strict=True)
            refused += tuple(shape for shape, support in named if support.name not in room.names)
        else:
            start = state.hypotheses.draft
        self._search((scans, self._air, accuracy, effort), start, replace(state, refused=refused))

    @Slot(int)
    def reject(self, row: int) -> None:
        """Remove a wall or post from the list; a running search is continued without it."""
        state = self.state
        if state.hypotheses is None or not 0 <= row < len(state.hypotheses.supports):
            return
        rest, refused = state.hypotheses.without(row), (*state.refused, state.hypotheses.shapes[row])
        self._set_state(replace(state, hypotheses=rest, refused=refused, places=()))
        if state.running:
            self._search(self._searching, rest.draft, self.state)

    @Slot()
    def plan_next(self) -> None:
        """Find where to scan next."""
        if self.state.answer is not None and not self.state.running:
            self._newest = None
            self._run(plan_next_scan, self.state.answer)
            self._set_state(replace(self.state, running="planning", places=(), share=0.0))

    @Slot()
    def note_accepted(self) -> None:
        """Note that the result was made the room of the window."""
        self._set_state(replace(self.state, accepted=True))

    @property
    def _scans(self) -> tuple[LoadedScan, ...]:
        return loaded_scans(self._shown(), self._name())

    @property
    def _air(self) -> Air:
        room = self._shown().scene.room
        return Air() if room is None else room.air

    def _search(self, searching: tuple[Any, ...], start: "RoomDraft | None", state: FindState) -> None:
        self._searching, self._newest = searching, None
        self._run(self._function, *searching, start, state.refused)
        here = room_of(self._shown().scene)
        self._set_state(replace(state, running="searching", places=(), searched_in=here, share=0.0))

    def _idle(self) -> FindState:
        """Return the state with the walls found so far."""
        return replace(self.state, running="") if self.state.running else self.state

    def _running(self, job: BackgroundJob) -> FindState:
        state = self.state
        if job.part is not self._newest:
            self._newest = job.part
            if state.running == "planning":
                state = replace(state, places=job.part)
            else:
                state = replace(state, hypotheses=job.part, answer=None, accepted=False)
        return state if job.share == state.share else replace(state, share=job.share)

    def _finished(self, answer: "RoomAnswer | tuple[NextPlace, ...]") -> FindState:
        if not isinstance(answer, RoomAnswer):
            return replace(self.state, running="", places=answer)
        state = replace(self.state, hypotheses=answer.hypotheses, answer=answer, accepted=False)
        return replace(state, running="", share=1.0)


def room_of(scene: Scene) -> tuple[str, str]:
    """Return name and file of the room of a scene, which edits do not change; empty without a room."""
    return room_name(scene), scene.room_file if scene.room is not None else ""
