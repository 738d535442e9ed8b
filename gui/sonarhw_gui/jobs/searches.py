"""The searches of the window: fit, causes of misfits, and the room that scans show."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import tomlkit
from PySide6.QtCore import QObject, Signal, Slot
from sonarhw_compare.edits import remove_surface
from sonarhw_compare.match import compare_readings
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import Board, without_own_body
from sonarhw_sim.room.room import Place, Room

from sonarhw.errors import Cancelled, InputError
from sonarhw.readings import Reading
from sonarhw_gui.jobs.jobs import RunControl, RunProgress
from sonarhw_gui.model.edits import Edit, room_and_place, with_sensor_at
from sonarhw_gui.model.look import LengthUnit, residual_unit
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
    from sonarhw_compare.locate import Pose, PoseSpread
    from sonarhw_compare.rooms.candidates import Support
    from sonarhw_compare.rooms.causes import FoundCauses
    from sonarhw_compare.rooms.draft import DraftPost, DraftWall, RoomDraft
    from sonarhw_compare.rooms.outcome import NextPlace
    from sonarhw_compare.rooms.search import FoundRoom

# Apply the values of a fit to a scene: place, range offset, air and materials.
#
# The texts of the room and the board change too, so that the result can be saved and recorded.


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


# A request to fit the pose of the scanner to its readings, and its answer.


NEAR = 0.25  # m; maximum error of a place that was set by hand
_SAMPLES = 8000  # samples of the posterior; about 300 of them are independent


@dataclass(frozen=True)
class FitSettings:
    """The free parameters of a fit, by their names in `values.quantities`, and whether to search the whole room."""

    free: tuple[str, ...] = ("position", "heading", "offset")
    everywhere: bool = False


@dataclass(frozen=True)
class FitSolution:
    """One solution of a fit."""

    values: "Mapping[Parameter, float]"
    within_5cm: float | None  # share of the echoes, in the fitted scene


@dataclass(frozen=True, eq=False)
class FitFound:
    """The result of a fit."""

    request: "FitRequest"
    result: "FitResult"
    within_5cm: float | None  # share of the echoes, before the fit
    solutions: tuple[FitSolution, ...]  # the best first


@dataclass(frozen=True)
class FitRequest:
    """Fit the pose of the scanner."""

    scene: Scene
    readings: tuple[Reading, ...]
    settings: FitSettings
    progress: RunProgress = field(compare=False)

    @property
    def scan(self) -> "PlacedScan":
        """The scan at its place in the room. Raises InputError without a room."""
        from sonarhw_compare.fit import PlacedScan  # takes half a second; only the first fit needs it

        return PlacedScan(self.readings, room_and_place(self.scene)[1], "this scan")

    def answer(self) -> FitFound:
        """Run the fit, which takes about ten seconds. Raises InputError, Cancelled."""
        from sonarhw_compare.fit import FitOptions, fit_scans

        scene, progress = self.scene, self.progress
        room, _ = room_and_place(scene)
        result = fit_scans(
            [self.scan],
            room,
            scene.board,
            self._free(room),
            options=FitOptions(scene.options, samples=_SAMPLES),
            progress=progress.report,
            cancelled=lambda: progress.cancelled,
        )
        solutions = tuple(self._solution(values) for values in _values(result))
        return FitFound(self, result, self._within_5cm(scene), solutions)

    def _free(self, room: Room) -> "tuple[Parameter, ...]":
        from sonarhw_compare.fit import free_parameters

        parameters = free_parameters(self.settings.free, ["this scan"], room, self.scene.board)
        if self.settings.everywhere:
            return parameters
        at = dict(zip("xy", self.scene.pose.position, strict=True))
        return tuple(
            replace(one, lower=at[name] - NEAR, upper=at[name] + NEAR) if name in at else one
            for name, one in ((one.quantity.name, one) for one in parameters)
        )

    def _solution(self, values: "Mapping[Parameter, float]") -> FitSolution:
        scene, _ = fitted(self.scene, values, self.scene.board)
        return FitSolution(values, self._within_5cm(scene))

    def _within_5cm(self, scene: Scene) -> float | None:
        room, _ = room_and_place(scene)
        compared = compare_readings(self.readings, room, scene.pose, scene.board, scene.options)
        return compared.summary().within_5cm


def _values(result: "FitResult") -> "list[Mapping[Parameter, float]]":
    """Return the values of every solution. The best one has the estimates, which are more accurate than its peak."""
    best = {one: result.estimates[one.name].value for one in result.parameters}
    return [best, *({one: mode.values[one.name] for one in result.parameters} for mode in result.modes[1:])]


# Starts, observes and cancels the fit, which runs in a thread; at most one at a time.


_MOST_READINGS = 720  # the newest ones; more readings of one place do not improve the fit


@dataclass(frozen=True)
class FitState:
    """State of the fit: none, running, or finished."""

    running: bool = False
    share: float = 0.0
    step: str = ""
    found: FitFound | None = None


class FitControl(RunControl):
    """At most one fit at a time."""

    def __init__(self, shown: Callable[[], Shown], parent: QObject) -> None:
        """`shown`: returns what the window shows."""
        super().__init__("fit", FitState(), parent)
        self._shown = shown

    @Slot(object)
    def start(self, settings: FitSettings) -> None:
        """Fit to the readings shown; a running fit is cancelled."""
        shown = self._shown()
        request = FitRequest(shown.scene, shown.readings[-_MOST_READINGS:], settings, RunProgress())
        self._run(request, self._running(request.progress))

    def _running(self, progress: RunProgress) -> FitState:
        return FitState(running=True, share=progress.share, step=progress.step)

    def _finished(self, answer: FitFound) -> FitState:
        return FitState(found=answer)


# The result of a fit as text: values with standard deviations, the share of matching echoes, warnings.


def rows(found: FitFound, solution: int, unit: LengthUnit) -> list[tuple[str, str, str]]:
    """Return name, value and standard deviation in the same unit. Only the best solution has deviations."""
    values = found.solutions[solution].values
    if solution > 0:
        return [(_name(one), value_text(one, value, unit), "") for one, value in values.items()]
    estimates = found.result.estimates
    return [
        (_name(one), _as_known(one, value, estimates[one.name], unit), _deviation(one, estimates[one.name], unit))
        for one, value in values.items()
    ]


def share_line(found: FitFound, solution: int) -> str:
    """Return the shares of echoes within 5 cm before the fit and with this solution."""
    before, after = (_percent(share) for share in (found.within_5cm, found.solutions[solution].within_5cm))
    return f"within 5 cm: {before} before, {after} after"


def solution_line(found: FitFound, solution: int, unit: LengthUnit) -> str:
    """Return the pose of a solution in one line."""
    values = found.solutions[solution].values
    pose = {one.quantity.name: value_text(one, value, unit) for one, value in values.items()}
    place = ", ".join(pose[name] for name in ("x", "y", "heading") if name in pose)
    return f"{solution + 1}: {place or 'same pose'}"


def warnings(found: FitFound) -> list[str]:
    """Return what the scan cannot determine, and whether the fit matches worse than before."""
    texts = [_warning_text(warning, found.request.settings) for warning in found.result.warnings]
    before, after = found.within_5cm, found.solutions[0].within_5cm
    if before is not None and after is not None and after < before:
        texts.append("fewer echoes match than before: the room differs from its file in something else")
    return texts


def _warning_text(warning: "FitWarning", settings: FitSettings) -> str:
    """Return a warning in the words of the window: its list has the solutions, and no command is named."""
    from sonarhw_compare.fit import FewExplained, SeveralSolutions

    match warning:
        case SeveralSolutions():
            return "several poses explain the scan about equally well, the room may be symmetric; try each above"
        case FewExplained(share=share):
            elsewhere = "" if settings.everywhere else ", or search in the whole room"
            return f"only {_percent(share)} of the echoes are within 5 cm; check the room and the board{elsewhere}"
        case _:
            return str(warning)


def _name(one: "Parameter") -> str:
    return f"{one.quantity.label} {one.of}".strip()


def value_text(one: "Parameter", value: float, unit: LengthUnit) -> str:
    """Return the text of a value with its unit."""
    match one.quantity.unit:
        case "°":
            return _signed(f"{math.degrees(value):z.2f}°")
        case "m" if one.quantity.word == "position":
            return _signed(unit.text(value))
        case "m":
            small = residual_unit(unit)
            return _signed(f"{value * small.per_metre:+z.{small.decimals + 1}f} {small.label}")
        case "":
            return f"{value:.3f}"
        case printed:
            return _signed(f"{value:z.1f} {printed}")


def _as_known(one: "Parameter", value: float, estimate: "Estimate", unit: LengthUnit) -> str:
    """Return a value with as many digits as its deviation justifies; a position in the unit of its deviation."""
    if one.quantity.word != "position":
        return value_text(one, value, unit)
    small = residual_unit(unit)
    decimals = min(2, _decimals(estimate.deviation * small.per_metre))
    return _signed(f"{value * small.per_metre:z.{decimals}f} {small.label}")


def _deviation(one: "Parameter", estimate: "Estimate", unit: LengthUnit) -> str:
    match one.quantity.unit:
        case "°":
            return f"± {_two_figures(math.degrees(estimate.deviation))}°"
        case "m":
            small = residual_unit(unit)
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


# Starts, observes and cancels the search for causes, which runs in a thread; at most one at a time.


_MOST_READINGS_OF_CAUSES = 360  # the newest ones; the time of a search is proportional to their number


@dataclass(frozen=True, eq=False)
class CausesAnswer:
    """The result of a search."""

    request: "CauseRequest"
    found: "FoundCauses"


@dataclass(frozen=True)
class CauseRequest:
    """Search for the causes of misfits."""

    scene: Scene
    readings: tuple[Reading, ...]
    first: int  # number of the first of them among the readings shown
    progress: RunProgress = field(compare=False)

    def answer(self) -> CausesAnswer:
        """Run the search, which takes about ten seconds. Raises InputError."""
        from sonarhw_compare.rooms.causes import find_causes  # takes half a second

        room, place = room_and_place(self.scene)
        progress = self.progress
        found = find_causes(
            self.readings,
            room,
            place,
            self.scene.board,
            tick=lambda share: progress.report(share, "searching"),
            cancelled=lambda: progress.cancelled,
        )
        return CausesAnswer(self, found)


@dataclass(frozen=True)
class CausesState:
    """State of the search: none, running, or finished."""

    running: bool = False
    share: float = 0.0
    answer: CausesAnswer | None = None


class CauseControl(RunControl):
    """At most one search at a time."""

    def __init__(self, shown: Callable[[], Shown], parent: QObject) -> None:
        """`shown`: returns what the window shows."""
        super().__init__("causes", CausesState(), parent)
        self._shown = shown

    @Slot()
    def start(self) -> None:
        """Search for changes of the room that explain misfits of the readings shown; a running search is cancelled."""
        shown = self._shown()
        newest = shown.readings[-_MOST_READINGS_OF_CAUSES:]
        request = CauseRequest(shown.scene, newest, len(shown.readings) - len(newest), RunProgress())
        self._run(request, self._running(request.progress))

    def _running(self, progress: RunProgress) -> CausesState:
        return CausesState(running=True, share=progress.share)

    def _finished(self, answer: CausesAnswer) -> CausesState:
        return CausesState(answer=answer)


# The search for the room, and for the next place to scan, as requests to a thread.


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


# The scans of the window that a search for the room uses: the one shown, and the visible ones of the panel Scans.


MOST_READINGS = 360  # of a scan, the newest ones; the time of a search is proportional to their number


def loaded_scans(shown: Shown, name: str) -> tuple[LoadedScan, ...]:
    """Return the scan shown, which gets `name`, and the visible scans drawn over it. Without readings, it is omitted.

    A scan shown of which the list has a part, such as a sweep, is omitted too.
    """
    listed = [one for one in shown.overlays if one.visible and one.readings]
    is_listed = any(share_readings(one.readings, shown.readings) for one in listed)
    scans = [] if is_listed or not shown.readings else [_loaded(name, shown.readings, shown.scene)]
    scans += [_loaded(one.name, one.readings, one.scene) for one in listed]
    first = next((scan for scan in scans if scan.known), None)
    ordered = scans if first is None else [first, *(scan for scan in scans if scan is not first)]
    return tuple(_with_own_names(ordered))


def share_readings(one: tuple[Reading, ...], other: tuple[Reading, ...]) -> bool:
    """Return whether two scans have a common reading, the same object."""
    return not {id(reading) for reading in one}.isdisjoint(id(reading) for reading in other)


def _loaded(name: str, readings: tuple[Reading, ...], scene: Scene) -> LoadedScan:
    known = scene.place is not None
    of_room = tuple(without_own_body(scene.board.own_body, readings))  # as the search counts them
    return LoadedScan(name, of_room[-MOST_READINGS:], scene.place or NOWHERE, scene.board, known)


def _with_own_names(scans: Iterable[LoadedScan]) -> Iterable[LoadedScan]:
    """Yield scans, with a number behind a name that another one has already."""
    used: set[str] = set()
    for scan in scans:
        name, number = scan.name or "scan", 2
        while name in used:
            name, number = f"{scan.name or 'scan'} {number}", number + 1
        used.add(name)
        yield replace(scan, name=name)


# Starts, observes, cancels and continues the search for the room, which runs in a thread; at most one at a time.


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
        found = self.answer is not None and self.accepted and room_name(scene) == self.answer.room.name
        return found or room_of(scene) == self.searched_in

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


class FindControl(RunControl):
    """At most one search at a time."""

    state: FindState
    settled = Signal()  # the scans or the scene of a search that has failed were changed

    def __init__(self, shown: Callable[[], Shown], name: Callable[[], str], parent: QObject) -> None:
        """`shown` returns what the window shows, `name` the name of the scan in it."""
        super().__init__("find the room", FindState(), parent)
        self._shown, self._name = shown, name
        self._newest: Hypotheses | None = None  # that `state` has
        self._request: FindRequest | None = None  # the newest search
        self._failed_with: tuple[Scene, tuple[OverlaidScan, ...]] | None = None
        self.failed.connect(self._note_failure)

    def tick(self) -> None:
        """Emit progress and result, and whether the cause of a failure may be gone."""
        super().tick()
        failed, now = self._failed_with, self._searched
        if failed is not None and any(one is not other for one, other in zip(failed, now, strict=True)):
            self._failed_with = None
            self.settled.emit()

    @Slot()
    def _note_failure(self) -> None:
        self._failed_with = self._searched

    @property
    def _searched(self) -> tuple[Scene, tuple[OverlaidScan, ...]]:
        return self._shown().scene, self._shown().overlays

    @Slot(object)
    def start(self, accuracy: Accuracy) -> None:
        """Start a search without walls in the loaded scans; a running one is cancelled."""
        if scans := self._scans:
            self._search(FindRequest(scans, self._air, accuracy, None, (), FindProgress()), FindState())

    @Slot(object)
    def go_on(self, accuracy: Accuracy) -> None:
        """Continue from the accepted and edited room, or else from the list; rejected walls are not found again."""
        state, scans, room = self.state, self._scans, self._shown().scene.room
        if state.hypotheses is None or not scans:
            return
        refused, found = state.refused, state.answer
        # edits of a room keep its name
        if state.accepted and found is not None and room is not None and room.name == found.room.name:
            from sonarhw_compare.rooms.draft import draft_of_room

            start = draft_of_room(room)
            named = zip(state.hypotheses.shapes, state.hypotheses.supports, strict=True)
            refused += tuple(shape for shape, support in named if support.name not in room.names)
        else:
            start = state.hypotheses.draft
        request = FindRequest(scans, self._air, accuracy, start, refused, FindProgress())
        self._search(request, replace(state, refused=refused))

    @Slot(int)
    def reject(self, row: int) -> None:
        """Remove a wall or post from the list; a running search is continued without it."""
        state = self.state
        if state.hypotheses is None or not 0 <= row < len(state.hypotheses.supports):
            return
        rest, refused = state.hypotheses.without(row), (*state.refused, state.hypotheses.shapes[row])
        self._set_state(replace(state, hypotheses=rest, refused=refused, places=()))
        if state.running and self._request is not None:
            again = replace(self._request, start=rest.draft, refused=refused, progress=FindProgress())
            self._search(again, self.state)

    @Slot()
    def plan_next(self) -> None:
        """Find where to scan next."""
        if self.state.answer is not None and not self.state.running:
            request = NextRequest(self.state.answer, FindProgress())
            self._begin(request, replace(self.state, running="planning", places=()))

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

    def _search(self, request: FindRequest, state: FindState) -> None:
        self._request = request
        self._begin(request, replace(state, running="searching", places=(), searched_in=room_of(self._shown().scene)))

    def _begin(self, request: FindRequest | NextRequest, state: FindState) -> None:
        self._newest = None
        self._run(request, replace(state, share=0.0))

    def _idle(self) -> FindState:
        """Return the state with the walls found so far."""
        return replace(self.state, running="") if self.state.running else self.state

    def _running(self, progress: FindProgress) -> FindState:
        state = self.state
        if progress.newest is not self._newest:
            self._newest = progress.newest
            state = replace(state, hypotheses=progress.newest, answer=None, accepted=False)
        if (progress.share, progress.places) != (state.share, state.places):
            state = replace(state, share=progress.share, places=progress.places)
        return state

    def _finished(self, answer: RoomAnswer | NextAnswer) -> FindState:
        if isinstance(answer, NextAnswer):
            return replace(self.state, running="", places=answer.places)
        found = replace(self.state, hypotheses=answer.hypotheses, answer=answer, accepted=False)
        return replace(found, running="", share=1.0)


def room_of(scene: Scene) -> tuple[str, str]:
    """Return name and file of the room of a scene, which edits do not change; empty without a room."""
    return room_name(scene), scene.room_file if scene.room is not None else ""
