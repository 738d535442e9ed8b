"""`sonarhw fit`, `locate` and `study`: values, poses and many predictions, with their tables."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from sonarhw_compare.fit.quantities import QUANTITIES, ROOM_TOLERANCE, BoardQuantity, PlaceQuantity, words_of
from sonarhw_compare.headings import estimate_degrees
from sonarhw_compare.picture_file import PICTURES

from sonarhw.errors import InputError, counted
from sonarhw_cli.inputs import LogFile, LogFiles, open_in_room, open_room, open_scan, print_place
from sonarhw_cli.options import (
    PICTURE_FILE,
    ROOM_NAME,
    BoardOfLog,
    Force,
    ReceiverChoice,
    RoomOfLog,
    deviation_text,
    estimate_text,
    print_error,
    print_json,
    print_line,
    warn,
    with_unit,
)
from sonarhw_cli.outputs import checked_out, progress, progress_of_share, write_figure, write_text

if TYPE_CHECKING:
    from sonarhw_compare.fit import Estimate, FitOptions, FitResult, Parameter
    from sonarhw_compare.fit.fitting import FitSetting
    from sonarhw_compare.locate import Located, Pose
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.room.room import Place, Room

# The result of a fit as a table for people or as JSON for programs, in degrees and metres, with its warnings.


_CORRELATED = 0.5  # weaker correlations are not printed


def fit_figures(result: "FitResult") -> dict[str, Any]:
    """Return the result of a fit under the keys of `fit --json`; headings in degrees."""
    return {
        "estimates": {
            parameter.name: {"unit": parameter.quantity.unit, **_scaled(parameter, result.estimates[parameter.name])}
            for parameter in result.parameters
        },
        "correlations": result.correlations.tolist(),
        "noise": result.noise,
        "log_likelihood": result.score,
        "answers": [
            {
                "log_likelihood": result.score + mode.score,
                **{one.name: mode.values[one.name] * one.quantity.per_unit for one in result.parameters},
            }
            for mode in result.modes
        ],
        "agreement": [
            {"n_echo": one.n_echo, "within_5cm": one.within_5cm, "explained": one.explained} for one in result.agreement
        ],
        "mismatches": [
            {
                "name": one.parameter.name,
                "unit": one.parameter.quantity.unit,
                "stated": (one.parameter.expected or 0.0) * one.parameter.quantity.per_unit,
                "shift": one.shift * one.parameter.quantity.per_unit,
                "deviation": one.deviation * one.parameter.quantity.per_unit,
                "or": list(one.alternatives),
            }
            for one in result.mismatches
        ],
        "warnings": [str(warning) for warning in result.warnings],
    }


def fit_lines(result: "FitResult") -> Iterator[str]:
    """Yield the table, the agreement, the noise and strong correlations of a fit."""
    width = max(len(parameter.name) for parameter in result.parameters)
    yield f"{'':{width}}  {'value':>12}  {'±':>10}  95 % interval"
    for parameter in result.parameters:
        yield f"{parameter.name:{width}}  {_row(parameter, result.estimates[parameter.name])}"
    yield ""
    yield f"{_agreement(result)} echoes within 5 cm of the fitted prediction"
    yield _noise_line(result.noise)
    names = list(result.estimates)
    for i, name in enumerate(names):
        for j in range(i):
            if abs(result.correlations[i, j]) >= _CORRELATED:
                yield f"{names[j]} and {name} are correlated: {result.correlations[i, j]:+.2f}"


def _row(parameter: "Parameter", estimate: "Estimate") -> str:
    shown, unit = _scaled(parameter, estimate), parameter.quantity.unit
    deviation = shown["deviation"]
    value, lower, upper = (estimate_text(shown[key], deviation) for key in ("value", "lower", "upper"))
    return f"{with_unit(value, unit):>12}  {deviation_text(deviation, unit):>10}  {lower} to {upper}"


def _agreement(result: "FitResult") -> str:
    """Return the share of echoes within 5 cm for each scan, in the order of the logs."""
    return "; ".join(f"{one.within_5cm:.0%} of {one.n_echo}" for one in result.agreement if one.within_5cm is not None)


def _noise_line(noise: dict[str, float]) -> str:
    return (
        f"errors of readings {noise['range_m'] * 1000:.1f} mm, of levels {noise['level_db']:.1f} dB; "
        f"{noise['missed']:.0%} of loud echoes missed, {noise['lost']:.0%} of pings lost, "
        f"{noise['stray_per_m']:.2f} stray echoes a metre{_stretch(noise)}"
    )


def _stretch(noise: dict[str, float]) -> str:
    # the stretch is not estimated if temperature or speed of sound is free
    return f"; ranges {noise['stretch'] - 1:+z.2%} from the speed of sound" if "stretch" in noise else ""


def _scaled(parameter: "Parameter", estimate: "Estimate") -> dict[str, float]:
    per_unit = parameter.quantity.per_unit
    return {key: getattr(estimate, key) * per_unit for key in ("value", "deviation", "lower", "upper")}


# `sonarhw fit`: fit place, heading, board and room to one or several logs, with credible intervals.


RoomOfFirstLog = Annotated[
    str | None,
    typer.Option("--room", help="Room: name or file; default: the room inside the first log.", metavar=ROOM_NAME),
]
PlacesOfLogs = Annotated[
    list[str] | None,
    typer.Option(
        "--place",
        help="Place, or X,Y in metres; once for each log. A free position is searched within 25 cm of it.",
        metavar="P",
    ),
]
FreeQuantities = Annotated[
    str,
    typer.Option(
        help=f"Quantities to fit: {words_of()}.",
        metavar="NAME,...",
    ),
]
Priors = Annotated[
    list[str] | None,
    typer.Option(
        "--prior",
        help="Prior of a quantity: NAME=VALUE+-DEVIATION (normal) or NAME=LOW..HIGH (bounds), in metres, degrees, °C, "
        "m/s or dB.",
        metavar="NAME=...",
    ),
]
WallTolerance = Annotated[
    float,
    typer.Option(
        help="Standard deviation of the position of each wall that is not free, in metres; 0: exact walls.",
        min=0.0,
        max=0.1,
    ),
]
Exact = Annotated[
    bool,
    typer.Option(
        "--exact",
        help="Take all that is not free as exact: walls, reflectances, threshold, aperture, turntable scale.",
    ),
]
Samples = Annotated[
    int,
    typer.Option(
        help="Samples drawn for the credible intervals; 0: use the curvature of the likelihood.",
        min=0,
        max=1_000_000,
    ),
]
FittedRoomFile = Annotated[
    Path | None,
    typer.Option(help="Write the fitted room: places, materials, walls, air.", metavar="ROOM.toml"),
]
FittedBoardFile = Annotated[
    Path | None,
    typer.Option(
        help=f"Write the fitted board profile: {words_of(BoardQuantity)}.",
        metavar="BOARD.toml",
    ),
]


def fit(
    log_files: LogFiles,
    room_name: RoomOfFirstLog = None,
    places: PlacesOfLogs = None,
    board: BoardOfLog = None,
    receiver: ReceiverChoice = None,
    free: FreeQuantities = "position,heading",
    priors: Priors = None,
    room_tolerance: WallTolerance = ROOM_TOLERANCE,
    exact: Exact = False,
    samples: Samples = 8000,
    seed: Annotated[int, typer.Option(help="Seed of the samples.", min=0, max=2**32 - 1)] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
    out: FittedRoomFile = None,
    board_out: FittedBoardFile = None,
    force: Force = False,
) -> None:
    """Fit place, heading, board and room to scans. Each value is printed with its credible interval."""
    _check_files(out, board_out, free, force, room_name, board, *log_files)
    from sonarhw_compare.fit import FitOptions
    from sonarhw_sim.predict.prediction import PredictionOptions

    prediction = PredictionOptions(receiver=receiver)
    options = FitOptions(prediction, seed, samples, room_tolerance=room_tolerance, exact=exact)
    fitted = _fitted(log_files, room_name, places or [], board, free, priors or [], options)
    _write_fitted(fitted, out, board_out, force)
    result = fitted.result
    if as_json:
        print_json(fit_figures(result))
    else:
        for line in fit_lines(result):
            print_line(line)
    for warning in result.warnings:
        warn(str(warning))


@dataclass(frozen=True)
class FittedLogs:
    """The input of a fit and its result."""

    setting: "FitSetting"
    result: "FitResult"

    def constrained(self) -> "dict[Parameter, float]":
        """Return the fitted values, without those that the scans hardly constrain and that have a former value."""
        from sonarhw_compare.fit.fitting import is_unconstrained

        estimates = self.result.estimates
        return {
            one: estimates[one.name].value
            for one in self.result.parameters
            if self.before(one) is None or not is_unconstrained(one, estimates[one.name])
        }

    def before(self, parameter: "Parameter") -> float | None:
        """Return the value before the fit; None for the pose of a scan whose place is unknown."""
        from sonarhw_compare.fit.parameters import present_value

        place = self.setting.scans[parameter.scan or 0].place
        if isinstance(parameter.quantity, PlaceQuantity) and not place.name:
            return None
        return present_value(parameter, place, self.setting.room, self.setting.board)

    def places(self, values: "Mapping[Parameter, float]") -> "tuple[Place, ...]":
        """Return the place of each scan with these values."""
        from sonarhw_compare.fit.parameters import applied

        given = [scan.place for scan in self.setting.scans]
        poses = {one: value for one, value in values.items() if isinstance(one.quantity, PlaceQuantity)}
        return applied(poses, self.setting.room, given, self.setting.board)[1]


def _fitted(
    log_files: Sequence[Path],
    room_name: str | None,
    places: Sequence[str],
    board: str | None,
    free: str,
    priors: Sequence[str],
    options: "FitOptions",
) -> FittedLogs:
    """Fit logs. Room, places and board that are not given are taken from them. Raises InputError if they have none."""
    from sonarhw_compare.fit import fit_scans
    from sonarhw_compare.fit.fitting import check_count, fit_setting
    from sonarhw_compare.fit.parameters import check_words
    from sonarhw_sim.board.profile import load_board

    words = [word for word in free.split(",") if word.strip()]
    # reading the logs may take seconds, so all else is checked first
    check_count(places, len(log_files))
    check_words(words, priors)
    room = None if room_name is None else open_room(room_name)
    wanted = places if room is None else [room.place(place) for place in places]
    given_board = load_board(board) if board else None
    given = [open_scan(file, board) for file in log_files]
    setting = fit_setting(given, room, wanted, given_board, words, priors)
    for scan in setting.scans:
        if scan.place.name:  # otherwise the whole room is searched
            print_place(setting.room, scan.place)
    with progress_of_share() as show:
        result = fit_scans(
            setting.scans, setting.room, setting.board, setting.parameters, options=options, progress=show
        )
    return FittedLogs(setting, result)


def _check_files(out: Path | None, board_out: Path | None, free: str, force: bool, *inputs: str | Path | None) -> None:
    """Raise InputError if a file cannot be written, or would contain no fitted value."""
    if out is None and board_out is None:
        return
    from sonarhw_compare.fit.parameters import quantities_of

    if out is not None and board_out is not None and out.resolve() == board_out.resolve():
        raise InputError(f"--out and --board-out: both are {out}; give each a file of its own")
    quantities = {quantity for word in free.split(",") if word.strip() for quantity in quantities_of(word)}
    of_board = [one for one in QUANTITIES if isinstance(one, BoardQuantity)]
    of_room = [one for one in QUANTITIES if one not in of_board]
    for option, file, those in (("--out", out, of_room), ("--board-out", board_out, of_board)):
        if file is None:
            continue
        checked_out(file, (".toml",), force, *inputs, option=option)
        if quantities.isdisjoint(those):
            names = ", ".join(map(str, those))
            raise InputError(f"{option} {file}: would contain no fitted value; add one of these to --free: {names}")


def _write_fitted(fitted: FittedLogs, out: Path | None, board_out: Path | None, force: bool) -> None:
    """Write the fitted room and the fitted board profile to the given files.

    Values that the scans hardly constrain stay as they were.
    """
    texts = []
    if out is not None:
        texts.append((out, "--out", _fitted_room(fitted).text))
    if board_out is not None:
        texts.append((board_out, "--board-out", _fitted_board(fitted, board_out.stem).text))
    for file, option, text in texts:
        write_text(file, text, force, option)


def _fitted_room(fitted: FittedLogs) -> "Room":
    """Return the fitted room with a list of its fitted values.

    A place of the room keeps its name. A place that is not in the room, or that several logs have, gets the name of its
    log.
    """
    from sonarhw_compare.fit.fitting import finding, fitted_room, kept, with_listed_findings

    setting, values = fitted.setting, fitted.constrained()
    names = [scan.place.name for scan in setting.scans]
    own = {name for name in setting.room.places if names.count(name) == 1}
    places = [
        replace(place, name=scan.place.name if scan.place.name in own else scan.name)
        for place, scan in zip(fitted.places(values), setting.scans, strict=True)
    ]
    lines = []
    for one in fitted.result.parameters:
        if isinstance(one.quantity, BoardQuantity):
            continue
        estimate, before = fitted.result.estimates[one.name], fitted.before(one)
        lines.append(
            finding(one, estimate.value, estimate.deviation, before) if one in values else kept(one, before or 0.0)
        )
    found = fitted_room(setting.room, values, places)
    return with_listed_findings(found, setting.room.name, lines, _log_names(fitted))


def _fitted_board(fitted: FittedLogs, name: str) -> "Board":
    from sonarhw_compare.fit.fitting import fitted_board

    values, estimates = fitted.constrained(), fitted.result.estimates
    deviations = {one: estimates[one.name].deviation for one in values}
    unconstrained = [
        one.name for one in fitted.result.parameters if one not in values and isinstance(one.quantity, BoardQuantity)
    ]
    return fitted_board(fitted.setting.board, values, name, deviations, _log_names(fitted), unconstrained)


def _log_names(fitted: FittedLogs) -> list[str]:
    return [Path(scan.file).name for scan in fitted.setting.scans]


# `sonarhw locate`: find the pose of a scan in a known room.


_ANY_HEADING = math.radians(90)  # standard deviation above which the heading counts as unknown
_CONTRADICTION = 4.0  # standard deviations between the heading of --heading and the one found
_RIVAL = 0.25  # a second pose with more than this share of the first's probability makes the answer ambiguous


Height = Annotated[
    float | None,
    typer.Option(help="Height of the transducer, metres; the prediction then includes floor and ceiling.", metavar="M"),
]
NearPlace = Annotated[
    float, typer.Option(help="Distance within which a pose counts as a place of the room, metres.", min=0)
]
KnownHeading = Annotated[
    float | None, typer.Option("--heading", help="Known heading of turntable step 0, degrees.", metavar="DEG")
]
HeadingDeviation = Annotated[
    float, typer.Option("--heading-sd", help="Standard deviation of --heading, degrees; 0 is exact.", min=0)
]


def locate(
    log_file: LogFile,
    room_name: RoomOfLog = None,
    board: BoardOfLog = None,
    receiver: ReceiverChoice = None,
    height: Height = None,
    heading: KnownHeading = None,
    heading_sd: HeadingDeviation = 5.0,
    near: NearPlace = 0.1,
    out: Annotated[Path | None, typer.Option(help="Draw the posterior in the plan.", metavar=PICTURE_FILE)] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the poses as JSON.")] = False,
    force: Force = False,
) -> None:
    """Find the pose of a scan in a known room. Each possible pose is printed with its probability."""
    if out is not None:
        checked_out(out, PICTURES, force, log_file, room_name, board)
    scan, room, chosen = open_in_room(log_file, room_name, board)
    from sonarhw_compare.locate import known_heading, locate_scan
    from sonarhw_sim.predict.prediction import PredictionOptions

    prediction = PredictionOptions(receiver=receiver)
    expected, spread = known_heading(None if heading is None else math.radians(heading), math.radians(heading_sd))
    with progress_of_share() as show:
        located = locate_scan(
            scan.readings,
            room,
            chosen,
            prediction=prediction,
            height=height,
            expected=expected,
            spread=spread,
            tick=lambda share: show(share, "locating"),
        )
    if out is not None:
        from sonarhw_compare.drawings import draw_located

        write_figure(out, draw_located(located), force)
    if as_json:
        print_json(_figures(located, near))
    else:
        for line in _lines(located, near):
            print_line(line)
    from sonarhw_compare.match import few_explained

    echoes = sum(reading.range is not None for reading in located.readings)
    few = few_explained(str(log_file), located.explained, echoes, located=True)
    turned = () if expected is None else _heading_doubts(located.poses[0], expected.heading, spread.heading)
    for doubt in (*few, *(f"{log_file}: {doubt}" for doubt in (*located.doubts, *turned))):
        warn(doubt)


def _heading_doubts(pose: "Pose", stated: float, deviation: float) -> tuple[str, ...]:
    """Return a warning if a pose contradicts the stated heading, rad, with this standard deviation, rad."""
    away = abs(math.remainder(pose.heading - stated, math.tau))
    if away <= _CONTRADICTION * math.hypot(deviation, pose.deviations[2]):
        return ()
    return (
        f"step 0 of the first pose is {math.degrees(away):.0f}° from --heading, which is unlikely with this "
        "--heading-sd; check both",
    )


def _figures(located: "Located", near: float) -> dict[str, Any]:
    from sonarhw_compare.match import explains_few

    places = located.places(near)
    return {
        "poses": [_figures_of(pose, _place_near(located, pose, near)) for pose in located.poses],
        "place": _likely_place(places),
        "places": {name: round(share, 6) for name, share in places.items()},
        "readings_alike": round(located.redundancy, 3),
        "explained": round(located.explained, 6),
        "fits_room": not explains_few(located.explained),
    }


def _place_near(located: "Located", pose: "Pose", near: float) -> "Place | None":
    return located.room.places.get(located.place_near(pose, near) or "")


def _likely_place(places: dict[str, float]) -> str | None:
    """Return the most probable of the room's places; None if none is possible."""
    best = max(places, key=places.__getitem__, default=None)
    return best if best is not None and places[best] > 0 else None


def _heading_degrees(pose: "Pose", place: "Place | None") -> float:
    """Return the heading of a pose, degrees, on the same turn as that of its place."""
    return estimate_degrees(pose.heading, 0.0 if place is None else place.heading, 6)


def _figures_of(pose: "Pose", place: "Place | None") -> dict[str, float | str | None]:
    dx, dy, turn = pose.deviations
    return {
        "x_m": round(pose.position[0], 6) + 0.0,
        "y_m": round(pose.position[1], 6) + 0.0,
        "heading_deg": _heading_degrees(pose, place),
        "offset_m": round(pose.offset, 6) + 0.0,
        "probability": round(pose.probability, 6),
        "place": None if place is None else place.name,
        "x_deviation_m": round(dx, 6),
        "y_deviation_m": round(dy, 6),
        "heading_deviation_deg": round(math.degrees(turn), 6) if turn <= _ANY_HEADING else None,
    }


def _lines(located: "Located", near: float) -> Iterator[str]:
    """Yield the lines to print: each pose, and whether the scan distinguishes them."""
    for pose in located.poses:
        yield _pose_line(pose, _place_near(located, pose, near))
    yield f"{located.explained:.0%} of the echoes are within 5 cm of an echo predicted for the first pose"
    first, *others = (pose.probability for pose in located.poses)
    if others and others[0] > _RIVAL * first:
        yield "the scan cannot distinguish these poses: the room looks nearly the same from them"
    places = located.places(near)
    if _likely_place(places) is not None:
        shares = ", ".join(f"{name} {share:.1%}" for name, share in places.items() if share >= 0.001)
        yield f"assuming one of the room's places: {shares}"


def _pose_line(pose: "Pose", place: "Place | None") -> str:
    dx, dy, _ = pose.deviations
    x, y = (estimate_text(at, spread) for at, spread in zip(pose.position, (dx, dy), strict=True))
    along_x, along_y = (deviation_text(spread * 1000, "") for spread in (dx, dy))
    offset = round(pose.offset * 1000)
    return (
        f"{pose.probability:6.1%}  at {x}, {y} m (± {along_x}, {along_y} mm), turntable step 0 at "
        f"{_heading_text(pose, place)}, range offset {f'{offset:+d}' if offset else '0'} mm"
        f"{'' if place is None else f'; {place.name}'}"
    )


def _heading_text(pose: "Pose", place: "Place | None") -> str:
    deviation = pose.deviations[2]
    if deviation > _ANY_HEADING:
        return "an unknown heading"
    degrees = math.degrees(deviation)
    return f"{estimate_text(_heading_degrees(pose, place), degrees)}° (± {deviation_text(degrees, '°')})"


# `sonarhw study`: predict thousands of scans over grids and random draws, into a folder of Parquet files.


StudyFile = Annotated[
    Path, typer.Argument(help="Study file (*.toml), such as docs/comparing/study_example.toml.", metavar="SPEC")
]
StudyFolder = Annotated[
    Path | None,
    typer.Option(
        help="Folder to create; default: the study file's name, in this folder.", metavar="DIR", show_default=False
    ),
]
Workers = Annotated[
    int | None, typer.Option(min=1, max=1024, help="Number of processes; default: one for each core.", metavar="N")
]
Scheduler = Annotated[
    str | None,
    typer.Option(help="Predict on the Dask cluster of this scheduler.", metavar="tcp://HOST:PORT"),
]


def study(
    spec: StudyFile,
    out: StudyFolder = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue an interrupted study.")] = False,
) -> None:
    """Predict every scan of a study. The results do not depend on the number of workers."""
    from sonarhw_compare.study import load_study, part_count, run_study, unfinished_of

    if workers is not None and scheduler is not None:
        raise InputError("--workers, --scheduler: a cluster has its own workers; give only one of them")
    folder = Path(spec.stem) if out is None else out
    plan = load_study(spec)
    with progress(part_count(plan), lambda: "Predicting") as advance:
        try:
            run_study(plan, folder, workers=workers, scheduler=scheduler, resume=resume, progress=advance)
        except KeyboardInterrupt:
            unfinished = unfinished_of(folder)
            if unfinished.exists():
                print_error(f"interrupted; finished parts are in {unfinished}: continue with --resume")
            raise
    print_line(f"{counted(plan.scans, 'scan')} in {folder}")
