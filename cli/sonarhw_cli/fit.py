"""`sonarhw fit`, `locate`, `track`, `map` and `study`: values, poses and rooms of scans, and many predictions."""

import math
import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from sonarhw_compare.fit.quantities import QUANTITIES, ROOM_TOLERANCE, BoardQuantity, words_of
from sonarhw_compare.picture_file import PICTURES
from sonarhw_compare.rooms.effort import Effort
from sonarhw_sim.air import Model

from sonarhw.errors import InputError, counted
from sonarhw_cli import options
from sonarhw_cli.inputs import (
    LogFile,
    LogFiles,
    check_one_of_each,
    note_assumed_heading,
    open_in_room,
    open_room,
    open_scan,
    place_of_pose,
)
from sonarhw_cli.outputs import checked_out, progress, progress_of_share, write_figure, write_text

if TYPE_CHECKING:
    from sonarhw_compare.fit.fitting import FittedScans
    from sonarhw_compare.rooms.outcome import MappedScans


# `sonarhw fit`: fit place, heading, board and room to one or several logs, with credible intervals.


RoomOfFirstLog = Annotated[
    str | None,
    typer.Option(
        "--room", help="Room: name or file; default: the room inside the first log.", metavar=options.ROOM_NAME
    ),
]
PlacesOfLogs = Annotated[
    list[str] | None,
    typer.Option(
        "--place",
        help="Place, or X,Y in metres and the heading; once for each log. A free position is searched within 25 cm.",
        metavar="NAME|X,Y[,DEG]",
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
    board: options.BoardOfLog = None,
    receiver: options.ReceiverChoice = None,
    free: FreeQuantities = "position,heading",
    priors: Priors = None,
    room_tolerance: WallTolerance = ROOM_TOLERANCE,
    exact: Exact = False,
    samples: Samples = 8000,
    seed: Annotated[int, typer.Option(help="Seed of the samples.", min=0, max=2**32 - 1)] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
    out: FittedRoomFile = None,
    board_out: FittedBoardFile = None,
    force: options.Force = False,
) -> None:
    """Fit place, board and room to scans (unknown place: `locate`).

    Each value is printed with its credible interval.
    """
    _check_files(out, board_out, free, force, room_name, board, *log_files)
    from sonarhw_compare import one_call
    from sonarhw_compare.fit.fitting import check_count
    from sonarhw_compare.fit.parameters import check_words
    from sonarhw_sim.board.profile import load_board

    words = [word for word in free.split(",") if word.strip()]
    # reading the logs may take seconds, so all else is checked first
    check_count(places or [], len(log_files))
    check_words(words, priors or [])
    room = None if room_name is None else open_room(room_name)
    wanted = places if room is None else [room.place(place) for place in places or []]
    profile = load_board(board) if board else None
    for place in () if "heading" in free else places or ():
        note_assumed_heading(place)
    scans = [open_scan(file, board) for file in log_files]
    with progress_of_share() as show:
        fitted = one_call.fit(
            scans,
            room,
            wanted,
            profile,
            free=words,
            priors=priors or [],
            receiver=receiver,
            samples=samples,
            seed=seed,
            room_tolerance=room_tolerance,
            exact=exact,
            progress=show,
            warn=options.warn,
        )
    _write_fitted(fitted, out, board_out, force)
    options.print_result(as_json, fitted.figures, fitted.lines)
    for doubt in fitted.doubts:
        options.warn(doubt)


def _check_files(out: Path | None, board_out: Path | None, free: str, force: bool, *inputs: str | Path | None) -> None:
    """Raise InputError if a file cannot be written, or would contain no fitted value."""
    if out is None and board_out is None:
        return
    from sonarhw_compare.fit.parameters import quantities_of

    if out is not None and board_out is not None and out.resolve() == board_out.resolve():
        raise InputError(f"--out and --board-out: both are {out}; give each a file of its own")
    quantities = {quantity for word in free.split(",") if word.strip() for quantity in quantities_of(word)}
    of_board = [quantity for quantity in QUANTITIES if isinstance(quantity, BoardQuantity)]
    of_room = [quantity for quantity in QUANTITIES if quantity not in of_board]
    for option, file, those in (("--out", out, of_room), ("--board-out", board_out, of_board)):
        if file is None:
            continue
        checked_out(file, (".toml",), force, *inputs, option=option)
        if quantities.isdisjoint(those):
            names = ", ".join(map(str, those))
            raise InputError(f"{option} {file}: would contain no fitted value; add one of these to --free: {names}")


def _write_fitted(fitted: "FittedScans", out: Path | None, board_out: Path | None, force: bool) -> None:
    """Write the fitted room and the fitted board profile to the given files."""
    texts = []
    if out is not None:
        texts.append((out, "--out", fitted.room_file().text))
    if board_out is not None:
        texts.append((board_out, "--board-out", fitted.board_file(board_out.stem).text))
    for file, option, text in texts:
        write_text(file, text, force, option)


NearPlace = Annotated[
    float, typer.Option(help="Distance within which a pose counts as a place of the room, metres.", min=0)
]
KnownHeading = Annotated[
    float | None, typer.Option("--heading", help="Known heading of turntable step 0, degrees.", metavar="DEG")
]
HeadingDeviation = Annotated[
    float, typer.Option("--heading-sd", help="Standard deviation of --heading, degrees; 0 is exact.", min=0)
]
_SMALL_OFFSET = 0.0025  # m, half a step of `compare --fit offset`


def locate(
    log_file: LogFile,
    room_name: options.RoomOfLog = None,
    board: options.BoardOfLog = None,
    receiver: options.ReceiverChoice = None,
    height: options.Height = None,
    heading: KnownHeading = None,
    heading_sd: HeadingDeviation = 5.0,
    near: NearPlace = 0.1,
    out: Annotated[
        Path | None, typer.Option(help="Draw the posterior in the plan.", metavar=options.PICTURE_FILE)
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the poses as JSON.")] = False,
    force: options.Force = False,
) -> None:
    """Find the pose of a scan in a known room (unknown room: `map`).

    Each possible pose is printed with its probability.
    """
    if out is not None:
        checked_out(out, PICTURES, force, log_file, room_name, board)
    scan, room, chosen = open_in_room(log_file, room_name, board)
    from sonarhw_compare import one_call

    with progress_of_share() as show:
        located = one_call.locate(
            scan,
            room,
            chosen,
            receiver=receiver,
            height=height,
            heading=None if heading is None else math.radians(heading),
            heading_deviation=math.radians(heading_sd),
            progress=lambda share: show(share, "locating"),
            warn=lambda _doubt: None,  # printed below
        )
    if out is not None:
        from sonarhw_compare.drawings import draw_located

        write_figure(out, draw_located(located), force)
    options.print_result(as_json, lambda: located.figures(near), lambda: located.lines(near))
    for doubt in located.doubts:
        options.warn(doubt)
    if not located.fits_room:
        return
    (x, y), heading = located.chosen.position, located.chosen.heading
    place = f"{x:.4f},{y:.4f},{math.degrees(heading):.3f}"
    named = {"--room": room_name, "--board": board, "--place": place}
    of_compare = {
        "--receiver": receiver,
        "--height": None if height is None else f"{height:g}",
        "--fit": "offset" if abs(located.chosen.offset) > _SMALL_OFFSET else None,
    }
    for command, of_command in (("compare", of_compare), ("gui", {})):  # in the window, both are settings
        given = {option: str(value) for option, value in {**named, **of_command}.items() if value is not None}
        written = " ".join(f"{option} {shlex.quote(value)}" for option, value in given.items())
        options.print_note(f"next: sonarhw {command} {shlex.quote(str(log_file))} {written}")


TrackStart = Annotated[
    str | None,
    typer.Option(
        help="Where the robot begins: everywhere searches the whole room; default: the place of the log, or else its "
        "first pose.",
        metavar="NAME|X,Y,DEG|everywhere",
    ),
]
TrackModel = Annotated[
    Literal["multipath", "nearest", "cone"],
    typer.Option(help="multipath follows sound; nearest is the first wall ahead, cone that within 15 degrees."),
]
TrackFiles = Annotated[
    list[Path] | None,
    typer.Option(
        help="Trajectory with standard deviations, or a picture. Once for each file.",
        metavar=f"FILE.csv|{options.PICTURE_FILE}",
    ),
]
_MODELS = {"multipath": Model.RAY_FOLLOWING, "nearest": Model.NEAREST, "cone": Model.CONE}


def track(
    log_file: LogFile,
    room_name: options.RoomOfLog = None,
    board: options.BoardOfLog = None,
    start: TrackStart = None,
    model: TrackModel = "multipath",
    particles: Annotated[int, typer.Option(help="Number of particles.", min=10, max=1_000_000)] = 1000,
    seed: Annotated[int, typer.Option(help="Seed of the particles; the same seed gives the same result.", min=0)] = 0,
    out: TrackFiles = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the trajectory as JSON.")] = False,
    force: options.Force = False,
) -> None:
    """Follow a robot through a known room, by its odometry and its sonar.

    A particle filter uses the steps between the poses of the log as odometry, and its readings. When the robot is lost,
    because no pose near the one stated explains its readings, it is searched in the room.
    """
    files: dict[bool, Path] = {}  # by whether it is a picture
    for path in out or ():
        is_picture = checked_out(path, [*PICTURES, ".csv"], force, log_file, room_name, board) != ".csv"
        if is_picture in files:
            raise InputError(f"--out {files[is_picture]}, --out {path}: give one picture and one .csv at most")
        files[is_picture] = path
    scan, room, chosen = open_in_room(log_file, room_name, board)
    from sonarhw_compare import one_call

    with progress_of_share() as show:
        tracked = one_call.track(
            scan,
            room,
            chosen,
            start,
            model=_MODELS[model],
            particles=particles,
            seed=seed,
            progress=lambda share: show(share, "tracking"),
            warn=lambda _doubt: None,  # printed below
        )
    if False in files:
        write_text(files[False], tracked.csv(), force)
    if True in files:
        from sonarhw_compare.drawings import draw_track

        write_figure(files[True], draw_track(tracked), force)
    options.print_result(as_json, tracked.figures, tracked.lines)
    for doubt in tracked.doubts:
        options.warn(doubt)


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

    folder = Path(spec.stem) if out is None else out
    plan = load_study(spec)
    with progress(part_count(plan), lambda: "Predicting") as advance:
        try:
            run_study(plan, folder, workers=workers, scheduler=scheduler, resume=resume, progress=advance)
        except KeyboardInterrupt:
            unfinished = unfinished_of(folder)
            if unfinished.exists():
                options.print_error(f"interrupted; finished parts are in {unfinished}: continue with --resume")
            raise
    options.print_line(f"{counted(plan.scans, 'scan')} in {folder}")


PlacesOfMap = Annotated[
    list[str] | None,
    typer.Option(
        "--place",
        help="Place of the room, or X,Y in metres and the heading; once for each log.",
        metavar="NAME|X,Y[,DEG]",
    ),
]
PosesOfLogs = Annotated[
    list[str] | None,
    typer.Option("--pose", help="Position, and heading of turntable step 0; once for each log.", metavar="X,Y,DEG"),
]
RoomToFollow = Annotated[
    str | None,
    typer.Option("--room", help="Follow sound in this room; default: the walls found.", metavar=options.ROOM_NAME),
]
PosesFile = Annotated[
    Path | None,
    typer.Option(
        "--poses",
        help="Poses of all logs, some uncertain or unknown; columns: "
        "log, x_m, y_m, heading_deg, sd_xy_m, sd_heading_deg.",
        metavar="FILE.csv",
    ),
]
MapFiles = Annotated[
    list[Path] | None,
    typer.Option(
        help="Picture of the maps. ROOM.toml, or a report .html with the maps beside the room: find the room. "
        "Once for each file.",
        metavar=f"ROOM.toml|FILE.html|{options.PICTURE_FILE}",
    ),
]
PlanNext = Annotated[bool, typer.Option("--next", help="Find the room, and where to scan next to learn most about it.")]
EffortOfMap = Annotated[
    Effort | None,
    typer.Option(help="Find the room: quick and rough, normal (default), or thorough. Quick implies --next."),
]


def map_logs(
    log_files: LogFiles,
    places: PlacesOfMap = None,
    poses: PosesOfLogs = None,
    room_name: RoomToFollow = None,
    board: options.BoardOfLog = None,
    offset: Annotated[float, typer.Option(help="Added to every measured range, metres.", min=-1, max=1)] = 0.0,
    poses_file: PosesFile = None,
    out: MapFiles = None,
    plan_next: PlanNext = False,
    effort: EffortOfMap = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print walls, corners and edges as JSON.")] = False,
    anyway: Annotated[bool, typer.Option("--anyway", help="Also write what is probably not a room.")] = False,
    force: options.Force = False,
) -> None:
    """Find the room from scans (known room: `locate`).

    A map has a certainty grid, and walls, corners and edges from regions of constant depth. Two maps are made: one
    from all readings, and one without the readings that came by several reflections. Those readings are found by
    following sound in the room.

    With --out ROOM.toml or --out FILE.html, the room is found: walls and posts that explain all echoes and silences, by
    the model of a fit, with their uncertainties. Sound is then followed in this room, and a picture shows it. If this
    is probably not a room, no file is written, and the exit status is 1; --anyway writes it.
    """
    files = _outputs(out or [], force, room_name, board, poses_file, *log_files)
    found_for = _option_that_finds(files, plan_next, effort)
    if found_for and room_name:
        raise InputError(f"{found_for}, --room {room_name}: a room is found, or given; give only one of them")
    room = None if room_name is None else open_room(room_name)
    scans = [open_scan(file, board) for file in log_files]
    check_one_of_each(places or [], poses or [], len(scans))
    for place in places or ():
        note_assumed_heading(place)
    from sonarhw_compare.one_call import map_room

    with progress_of_share() as show:
        mapped = map_room(
            scans,
            [place_of_pose(pose) for pose in poses] if poses else places,
            room,
            board,
            poses=poses_file,
            offset=offset,
            find=bool(found_for),
            plan_next=plan_next,
            effort=effort or Effort.NORMAL,
            progress=show,
            warn=options.warn,
        )
    mapped = replace(mapped, doubts=tuple(map(options.with_options, mapped.doubts)))
    for doubt in mapped.doubts:
        options.warn(doubt)
    is_refused = mapped.found is not None and not mapped.found.verdict.is_room and not anyway
    if not is_refused:
        _write(files, mapped, force)
    options.print_result(as_json, mapped.figures, mapped.lines)
    if is_refused:
        names = ", ".join(str(path) for path in files.values())
        options.print_note(f"{f'not written: {names}; ' if names else ''}--anyway accepts what was found")
        raise typer.Exit(1)


def _outputs(out: Sequence[Path], force: bool, *inputs: str | Path | None) -> dict[str, Path]:
    """Return the files to write: a room, a report and a picture at most."""
    kinds, files = {".toml": "room", ".html": "report"}, dict[str, Path]()
    for path in out:
        kind = kinds.get(checked_out(path, [*PICTURES, *kinds], force, *inputs), "picture")
        if kind in files:
            raise InputError(
                f"--out {files[kind]}, --out {path}: give one room file, one report and one picture at most"
            )
        files[kind] = path
    return files


def _option_that_finds(files: dict[str, Path], plan_next: bool, effort: Effort | None) -> str:
    """Return the option that needs a found room, such as `--out FILE`; empty if none does."""
    if file := files.get("room") or files.get("report"):
        return f"--out {file}"
    return "--next" if plan_next else f"--effort {effort}" if effort else ""


def _write(files: dict[str, Path], mapped: "MappedScans", force: bool) -> None:
    """Write room file, report and picture."""
    if mapped.found and "room" in files:
        write_text(files["room"], mapped.found.room.text, force)
    if mapped.found and "report" in files:
        from sonarhw_compare.report import map_report_html

        write_text(files["report"], map_report_html(mapped), force)
    if "picture" in files:
        write_figure(files["picture"], mapped.draw(), force)
