"""`sonarhw simulate`, `paths` and `figures`: predict scans, list paths, and draw the paper's figures."""

import math
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from sonarhw_compare.picture_file import FILMS, PICTURES
from sonarhw_sim.air import DEFAULT_BOARD, ROOM_TOLERANCE, EdgeStrength, Model, Receiver, Unit

from sonarhw.errors import InputError, counted, in_degrees
from sonarhw.files import atomic_file
from sonarhw.wire.limits import LONGEST_TRACE
from sonarhw_cli import options, outputs
from sonarhw_cli.inputs import note_assumed_heading, open_room, print_place

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from sonarhw_sim.air import Air
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.predict.predicted_scan import PredictedScan
    from sonarhw_sim.predict.prediction import PredictionOptions
    from sonarhw_sim.room.room import Place, Room

    from sonarhw.readings import FloatArray, ScanOrder, Trace

# Output of `sonarhw simulate`: a predicted scan as rows, arrays, picture or log, also with receive signals.


PROBABILITY_HEADER = "heading_deg,range_m,probability,via"
HEADER = "heading_deg,range_m,path_m,level_db,bounces,via"
_PING_PERIOD = 0.1  # s between the readings in the log of a predicted scan


TraceForm = Literal["rf", "sampled", "envelope"]  # in which receive signals are written
USUAL_RATES: dict[TraceForm, float] = {"rf": 1e6, "sampled": 16e6 / 16 / 13, "envelope": 50e3}  # Hz
SLOWEST, FASTEST = 1e3, 1e6  # Hz
_SAMPLE_BYTES: dict[TraceForm, int] = {"rf": 4, "sampled": 1, "envelope": 4}  # in an .npz file
_MOST_BYTES = 4e9  # of all traces in a file
_MOST_BYTES_IN_MEMORY = 5e8  # of all traces for a log, which is encoded from memory


@dataclass(frozen=True)
class TraceSettings:
    """The form and rate of the traces to write."""

    kind: TraceForm
    rate: float  # Hz


def trace_settings(kind: TraceForm | None, rate: float | None, suffix: str) -> TraceSettings | None:
    """Return the traces of --traces and --rate. Raises InputError if they do not fit the file format `suffix`."""
    if kind is None:
        return None
    if suffix not in (".npz", options.LOG) or (suffix == options.LOG and kind != "envelope"):
        fitting = ".npz or .mcap" if kind == "envelope" else ".npz"
        raise InputError(f"--traces {kind}: needs a file of format {fitting}; name one with --out")
    chosen = USUAL_RATES[kind] if rate is None else rate
    if not SLOWEST <= chosen <= FASTEST:
        raise InputError(f"--rate {chosen:g}: expected {SLOWEST:g} to {FASTEST:g} Hz")
    return TraceSettings(kind, chosen)


def check_trace_size(traces: TraceSettings, suffix: str, listening: float, headings: int) -> None:
    """Raise InputError if traces of `listening` s are too long for a log, or too large together."""
    samples = math.ceil(listening * traces.rate)
    if suffix == options.LOG and samples > LONGEST_TRACE:
        most = math.floor(LONGEST_TRACE / listening)
        raise InputError(
            f"--rate {traces.rate:g}: a trace in a log has at most {LONGEST_TRACE} samples; give {most} or less"
        )
    sample, most_bytes = (
        (8, _MOST_BYTES_IN_MEMORY) if suffix == options.LOG else (_SAMPLE_BYTES[traces.kind], _MOST_BYTES)
    )
    needed = headings * samples * sample
    if needed > most_bytes:
        raise InputError(
            f"--traces {traces.kind}: {headings} traces of {samples} samples need {needed / 1e9:.1f} GB, "
            f"at most {most_bytes / 1e9:g} GB are possible; give a larger --step or a lower --rate"
        )


def prediction_rows(scan: "PredictedScan") -> Iterator[tuple[float | int | str | None, ...]]:
    """Yield the columns of HEADER, one row for each heading; None for an unknown value."""
    from sonarhw_sim.board.profile import OWN_BODY

    scan = scan.near
    bounces, ranges = scan.paths.bounces, scan.ranges
    for k, (heading, winner) in enumerate(zip(scan.headings, scan.winners, strict=True)):
        distance = None if math.isnan(ranges[k]) else float(ranges[k])
        if winner < 0:
            via = OWN_BODY if scan.of_own_body is not None and scan.of_own_body[k] else None
            yield math.degrees(heading), distance, None, None, None, via
            continue
        # the directivity straight ahead is 1 except for rounding: write 0 dB, not -1e-13
        length, level = float(scan.paths.lengths[winner]), round(scan.ping(k).level_of_reading, 9) + 0.0
        via = ">".join(scan.paths.via(int(winner), scan.room))
        yield math.degrees(heading), distance, length, level, int(bounces[winner]), via


def probability_rows(
    scan: "PredictedScan", pings: int | None, room_tolerance: float | None
) -> Iterator[tuple[float | str | None, ...]]:
    """Yield the columns of PROBABILITY_HEADER: at each heading every range that may be reported, and silence last."""
    from sonarhw_sim.predict.probability import possible_readings, range_chances

    tolerance = ROOM_TOLERANCE if room_tolerance is None else room_tolerance
    for k, heading in enumerate(scan.headings):
        for outcome in possible_readings(scan, k, pings or 1, tolerance):
            via = ">".join(scan.paths.via(outcome.path, scan.room)) if outcome.path >= 0 else None
            for distance, probability in range_chances(outcome, scan.board):
                yield math.degrees(heading), distance, probability, via


def write_predicted_npz(scan: "PredictedScan", traces: TraceSettings | None, out: Path, force: bool) -> None:
    """Write the columns as arrays; with traces also `trace`, one row for each heading, and `trace_rate_hz`.

    Traces are computed and written one by one, because those of a fine scan do not fit into memory.
    """
    import numpy as np

    from sonarhw.npz import write_array

    *numbers, via = zip(*prediction_rows(scan), strict=True)
    columns = [np.array(column, dtype=float) for column in numbers] + [np.array([touched or "" for touched in via])]
    named = dict(zip(HEADER.split(","), columns, strict=True))
    if traces is not None:
        named |= {"trace_rate_hz": np.array(traces.rate)}
    with outputs.written_file(out, overwrite=force) as file, zipfile.ZipFile(file, "w") as archive:
        for name, column in named.items():
            write_array(archive, name, column.shape, column.dtype, [column])
        if traces is not None:
            first = _samples(scan, 0, traces)
            others = (_samples(scan, k, traces) for k in range(1, len(scan.headings)))
            write_array(archive, "trace", (len(scan.headings), *first.shape), first.dtype, chain([first], others))


def _samples(scan: "PredictedScan", index: int, traces: TraceSettings) -> "NDArray[np.generic]":
    import numpy as np

    signal = scan.ping(index).signal(_listening(scan))
    match traces.kind:
        case "rf":
            return signal.rf(traces.rate).astype(np.float32)
        case "sampled":
            # counts of the converter: 128 is full scale
            return (signal.sampled(traces.rate) * 128).astype(np.int8)
        case "envelope":
            return signal.envelope(traces.rate).samples.astype(np.float32)


def listening_time(board: "Board", air: "Air") -> float:
    """Return the listening time of a ping for the range of the board, s."""
    return 2 * board.max_range / air.speed_of_sound


def _listening(scan: "PredictedScan") -> float:
    return listening_time(scan.board, scan.room.air)


def write_predicted_picture(scan: "PredictedScan", out: Path, force: bool) -> None:
    """Write the plan of the room with the prediction as a picture."""
    from sonarhw_compare.drawings import draw_plan

    title = f"{scan.room.name}, {scan.where}, board {scan.board.name}"
    outputs.write_figure(out, draw_plan(scan, title=title), force)


def write_film_of_sound(scan: "PredictedScan", out: Path, suffix: str, force: bool) -> None:
    """Write a film of the sound at the first heading."""
    from sonarhw_compare.film import FilmTiming
    from sonarhw_compare.picture_file import write_film
    from sonarhw_compare.sound import PlayedPing

    with outputs.written_file(out, overwrite=force) as file:
        write_film(PlayedPing(scan, 0), FilmTiming(), file, suffix)


def write_predicted_log(
    scan: "PredictedScan", traces: TraceSettings | None, room_file: str, out: Path, force: bool
) -> None:
    """Write the log of a scanner that measures exactly the prediction."""
    import time

    from sonarhw.log import LogMetadata
    from sonarhw.log.writer import write_scan
    from sonarhw.readings import Reading

    air = scan.room.air
    readings = [
        Reading(
            number=number,
            sweep=0,
            ping=0,
            angle=scan.board.angle_at(float(heading), scan.place.heading),
            time=number * _PING_PERIOD,
            echo_times=_echo_times(scan, number),
            speed_of_sound=air.speed_of_sound,
            temperature_c=air.temperature_c,
            trace=None if traces is None else _envelope(scan, number, traces),
        )
        for number, heading in enumerate(scan.headings)
    ]
    metadata = LogMetadata(
        made_by="simulate",
        started=time.time(),
        room_file=room_file,
        room_text=scan.room.text,
        place=scan.place.name,
        board=scan.board.name,
        board_text=scan.board.text,
    )
    write_scan(out, metadata, readings, overwrite=force)
    outputs.print_written(out)


def _echo_times(scan: "PredictedScan", index: int) -> tuple[float, ...]:
    """Return all echo times that the board would report, s; only the first is rounded as the board does."""
    if math.isnan(scan.ranges[index]):
        return ()
    first = 2 * float(scan.ranges[index]) / scan.room.air.speed_of_sound
    times = [float(time) for time in scan.ping(index).echo_times()]
    if scan.of_own_body is not None and scan.of_own_body[index]:
        return (first, *(time for time in times if time > first))
    return (first, *times[1:])


def _envelope(scan: "PredictedScan", index: int, traces: TraceSettings) -> "Trace":
    return scan.ping(index).signal(_listening(scan)).envelope(traces.rate)


# Checks of the options of `sonarhw simulate`: those that exclude each other, or have no effect.


@dataclass(frozen=True)
class PredictionInput:
    """What a scan is predicted from."""

    room: "Room"
    place: "Place"
    board: "Board"
    headings: "FloatArray"  # (n,), rad in the room
    model: Model
    options: "PredictionOptions"

    def scan(self, every_path: bool) -> "PredictedScan":
        """Return the prediction by the model, with paths beyond those of its readings if these are needed."""
        from sonarhw_sim.predict.prediction import predict_with
        from sonarhw_sim.predict.settled import predict_readings

        if self.model is Model.RAY_FOLLOWING and not every_path:
            return predict_readings(self.room, self.place, self.board, self.headings, self.options)
        return predict_with(self.model, self.room, self.place, self.board, self.headings, self.options)


def check_input(given: PredictionInput, kind: str, traces: TraceSettings | None) -> None:
    """Raise InputError for options that exclude each other or have no effect, MissingExtra if a film needs PyAV."""
    _check_noise(given, traces)
    _check_effect(given)
    if kind in FILMS:
        _check_film(given, kind)
    if traces is not None:
        check_trace_size(traces, kind, listening_time(given.board, given.room.air), len(given.headings))


def _check_film(given: PredictionInput, suffix: str) -> None:
    """Raise InputError if a film is not possible, MissingExtra if it needs PyAV."""
    from sonarhw_compare.picture_file import check_film

    if not given.model.follows_sound:
        raise InputError(f"--model {given.model}: a film needs a model that follows sound")
    if len(given.headings) != 1:
        raise InputError(
            f"--out *{suffix}: a film shows one heading, not {len(given.headings)}; "
            "give for example --from 270 --to 271 --step 1"
        )
    check_film(suffix)


def _check_noise(given: PredictionInput, traces: TraceSettings | None) -> None:
    noise, receiver = given.options.noise, given.options.receiver_of(given.board, given.model)
    if not 0 <= noise <= 1:
        raise InputError(f"--noise {noise:g}: expected 0 to 1, which is full scale")
    if noise and traces is None and receiver is Receiver.FIRST_ECHO:
        raise InputError(f"--noise {noise:g}: has no effect without --traces or --receiver board; add one")


def _check_effect(given: PredictionInput) -> None:
    """Raise InputError for options without an effect."""
    model, prediction, place, board = given.model, given.options, given.place, given.board
    if prediction.sections > 1 and place.height is None:
        raise InputError(
            f"--sections {prediction.sections}: place {place.name!r} has no height; add one to the room file"
        )
    if not model.follows_sound and prediction.unit is not Unit.PASS:
        raise InputError(f"--unit {prediction.unit}: has no effect with --model {model}; leave it out")
    if prediction.grain is not None:
        _check_grain(prediction.grain, given.room, model)
    if prediction.own_body and not board.own_body:
        raise InputError(f"--own-body: board {board.name!r} has no own_body; `sonarhw calibrate` finds it from logs")


def _check_grain(grain: int, room: "Room", model: Model) -> None:
    if not room.scattered.any():
        raise InputError(f"--grain {grain}: has no effect: no surface of room {room.name!r} has scatter; leave it out")
    if not model.follows_sound:
        raise InputError(f"--grain {grain}: has no effect with --model {model}; leave it out")


# Warnings about a predicted scan: what it approximates, and why it has no echo.


def warn_of_doubts(scan: "PredictedScan", model: "Model") -> None:
    """Warn about readings in the near field or of noise, a face outside the room, and a scan without an echo."""
    from sonarhw_sim.predict.settled import noise_doubts

    if model.follows_sound:
        _warn_of_near_field(scan)
    _warn_of_face_outside(scan)
    _warn_of_silence(scan)
    for doubt in noise_doubts(scan.board, scan.noise, scan.receiver):
        options.warn(doubt)


def _warn_of_near_field(scan: "PredictedScan") -> None:
    """Warn about readings in the near field, where the directivity of the far field is wrong."""
    import numpy as np
    from sonarhw_sim.board.beam import far_field

    begins = far_field(scan.board.aperture_radius, scan.board.wavelength(scan.room.air))
    near = int((scan.distances[~np.isnan(scan.distances)] < begins).sum())
    if near:
        options.warn(
            f"{counted(near, 'reading')} nearer than {begins:.3f} m, where the far field of the "
            "transducer begins: their beam loss is approximate"
        )


def _warn_of_silence(scan: "PredictedScan") -> None:
    """Warn if no heading has an echo, with the reason; that the place is outside the room is printed already."""
    import numpy as np
    from sonarhw_sim.check import reason_for_silence

    if np.isnan(scan.ranges).all() and not scan.room.is_outside(scan.place.position):
        options.warn(f"no echo: {reason_for_silence(scan.room, scan.place, scan.board)}")


def _repeat_silence_outside(scan: "PredictedScan") -> None:
    """Warn again below many rows without an echo that the place is outside the room."""
    import numpy as np
    from sonarhw_sim.room.room import place_doubts

    if np.isnan(scan.ranges).all() and scan.room.is_outside(scan.place.position):
        options.warn(f"no heading has an echo: {'; '.join(place_doubts(scan.room, scan.place))}")


def _warn_of_face_outside(scan: "PredictedScan") -> None:
    """Warn if the place is inside the room, but the mount or ring puts the face outside."""
    if scan.board.mounting.turns_about_face or scan.room.is_outside(scan.place.position):
        return
    outside = sum(scan.room.is_outside((x, y)) for x, y in scan.standpoints.tolist())
    if outside:
        options.warn(
            f"at {counted(outside, 'heading')} of {len(scan.headings)} board {scan.board.name!r} "
            f"has its face outside room {scan.room.name!r}; move the place, or check [mount] or [ring]"
        )


# `sonarhw simulate`: predict a scan and write it as CSV, NPZ, picture or log.


WHOLE_CIRCLE = (0.0, 360.0, 5.0)  # degrees: from, to, step
_CSV = (".csv", options.STDOUT)
_FORMATS = (".csv", ".npz", *PICTURES, options.LOG, *FILMS, options.STDOUT)


FaceEffect = Annotated[Unit, typer.Option(help="Effect of the transducer's face on sound that passes it.")]
Sections = Annotated[
    int,
    typer.Option(min=1, max=99, help="Horizontal sections across the face, for a place with a height."),
]
TracesToWrite = Annotated[
    TraceForm | None,
    typer.Option(
        help="Write the receive signals: rf, with the carrier (.npz); sampled, as by an 8-bit converter at "
        "76.9 kHz, 128 is full scale (.npz); envelope (.npz, .mcap)."
    ),
]
TraceRate = Annotated[
    float | None,
    typer.Option(
        help="Sampling rate of traces, Hz, 1000 to 1000000. Default: rf 1000000, sampled 76923, envelope 50000."
    ),
]
ReceiverNoise = Annotated[
    float, typer.Option(help="Receiver noise, rms, 0 to 1 (full scale). Needs --traces or --receiver board.")
]
RandomSeed = Annotated[
    int | None,
    typer.Option(min=0, help="Seed of random values; without one, --model nearest has no random errors."),
]
SpeckleSeed = Annotated[
    int | None,
    typer.Option(min=0, help="Seed of the speckle of rough surfaces; default: the mean power of all speckles."),
]
AsProbability = Annotated[
    bool, typer.Option("--probability", help="Write the probability of each range, and of silence, as CSV.")
]
WithOwnBody = Annotated[
    bool, typer.Option("--own-body", help="Also predict the echoes of the carrier's own body in the profile.")
]
PredictionFile = Annotated[
    str,
    typer.Option(
        help=".csv, .npz, .png, .pdf, .svg, .mcap; .gif, .mp4, .webm: a film of the sound at one heading; "
        "- for CSV on standard output.",
        metavar="FILE",
    ),
]


def simulate(
    room_name: options.RoomName,
    place: options.PlaceName = None,
    start: options.FromDegrees = WHOLE_CIRCLE[0],
    stop: options.ToDegrees = WHOLE_CIRCLE[1],
    step: options.StepDegrees = WHOLE_CIRCLE[2],
    board: options.BoardName = DEFAULT_BOARD,
    receiver: options.ReceiverChoice = None,
    unit: FaceEffect = Unit.PASS,
    edge_strength: options.EdgeStrengthChoice = None,
    sections: Sections = 1,
    model: options.ModelChoice = Model.RAY_FOLLOWING,
    traces: TracesToWrite = None,
    rate: TraceRate = None,
    noise: ReceiverNoise = 0.0,
    seed: RandomSeed = None,
    grain: SpeckleSeed = None,
    probability: AsProbability = False,
    pings: options.PingsOfMedian = None,
    room_tolerance: options.RoomTolerance = None,
    own_body: WithOwnBody = False,
    out: PredictionFile = "-",
    force: options.Force = False,
) -> None:
    """Predict a scan as CSV, NPZ, picture or log.

    The prediction is the range that the board would report at each heading, and the path of the sound.

    If the board profile has a [mount], the face turns about an axis at the place. If it has a [ring], there is one row
    for each sensor, at the heading of that sensor, and --from, --to and --step are refused.

    With --probability, each row is a range that the board may report at a heading, or silence, whose range is empty.
    The spreads are threshold_sd_db and range_sd of the board profile, and --room-tolerance.
    """
    from sonarhw_sim.board.profile import load_board
    from sonarhw_sim.predict.prediction import PredictionOptions

    kind = outputs.checked_out(out, _CSV if probability else _FORMATS, force, room_name, board)
    settings = trace_settings(traces, rate, kind)
    order = options.order_in_degrees(start, stop, step)
    options.warn_of_radians(start, stop)
    room, profile = open_room(room_name), load_board(board)
    named = room.place(place)
    print_place(room, named)
    if profile.ring is not None or kind == options.LOG:  # in which headings are those of the turntable
        note_assumed_heading(place)
    here = profile.faced(named)
    prediction = PredictionOptions(
        unit=unit,
        edge_strength=edge_strength,
        receiver=receiver,
        noise=noise,
        seed=seed,
        grain=grain,
        sections=sections,
        own_body=own_body,
    )
    given = PredictionInput(room, here, profile, _headings(order, profile, here), model, prediction)
    check_input(given, kind, settings)
    if probability:
        scan = _scan_of_spreads(given, pings or 1)
    else:
        scan = given.scan(settings is not None or kind in (*PICTURES, *FILMS))
    warn_of_doubts(scan, model)
    if probability:
        with outputs.text_output(out, force) as file:
            options.write_rows(file, PROBABILITY_HEADER, probability_rows(scan, pings, room_tolerance))
    else:
        _write(scan, kind, out, force, settings, room_name)
    if out == options.STDOUT:
        _repeat_silence_outside(scan)


def _write(
    scan: "PredictedScan", kind: str, out: str, force: bool, settings: TraceSettings | None, room_name: str
) -> None:
    from sonarhw_sim.files import file_name

    match kind:
        case ".npz":
            write_predicted_npz(scan, settings, Path(out), force)
        case suffix if suffix in PICTURES:
            write_predicted_picture(scan, Path(out), force)
        case suffix if suffix in FILMS:
            write_film_of_sound(scan, Path(out), suffix, force)
        case ".mcap":
            write_predicted_log(scan, settings, file_name(room_name), Path(out), force)
        case _:
            with outputs.text_output(out, force) as file:
                options.write_rows(file, HEADER, prediction_rows(scan))


def _scan_of_spreads(given: PredictionInput, pings: int) -> "PredictedScan":
    from sonarhw_sim.predict.probability import check_pings, scan_with_fainter_paths

    check_pings(pings)
    board = given.board
    if not board.threshold_sd_db:
        options.warn(
            f"board profile {board.name!r} has no threshold_sd_db: every echo is either certain or impossible; "
            "write the spread of its threshold into a profile of your own"
        )
    return scan_with_fainter_paths(given.room, given.place, board, given.headings, given.options)


def _headings(order: "ScanOrder", board: "Board", place: "Place") -> "FloatArray":
    """Return the requested headings, or those of the sensors of a ring. Raises InputError if both are given."""
    if board.ring is None:
        return order.angles()
    if order != options.order_in_degrees(*WHOLE_CIRCLE):
        raise InputError(
            f"board {board.name!r} is a ring of {board.ring.sensors} sensors, which does not turn; "
            "leave out --from, --to and --step"
        )
    return board.ring.headings(place)


# `sonarhw paths`: list every path of sound from a place back to it, for all headings.


PATHS_HEADER = "length_m,departure_deg,arrival_deg,gain,bounces,via"


HalfLength = Annotated[
    float | None,
    typer.Option(min=0, max=1000, help="List paths up to twice this length, metres; default: the board's range."),
]
FaintestEdge = Annotated[
    float,
    typer.Option(
        max=0,
        help="Omit paths that are fainter than this after an edge, dB; each 10 dB less takes several times longer.",
    ),
]


def paths(
    room_name: options.RoomName,
    place: options.PlaceName = None,
    max_bounces: Annotated[int, typer.Option(min=0, max=1000, help="Largest number of reflections.")] = 64,
    max_range: HalfLength = None,
    no_diffraction: Annotated[bool, typer.Option("--no-diffraction", help="Omit paths around edges.")] = False,
    edge_strength: options.EdgeStrengthChoice = None,
    faintest: FaintestEdge = -60.0,
    out: Annotated[str, typer.Option(help="File to write; - is standard output.", metavar="FILE.csv")] = "-",
    force: options.Force = False,
) -> None:
    """List every path of sound from a place back to it. The shortest is first."""
    from sonarhw_sim.board.profile import load_board
    from sonarhw_sim.rays.paths import PathSearch
    from sonarhw_sim.space.sections import paths_from

    outputs.checked_out(out, (".csv", options.STDOUT), force, room_name)
    room = open_room(room_name)
    here, board = room.place(place), load_board(DEFAULT_BOARD)
    print_place(room, here)
    reach = board.max_range if max_range is None else max_range
    search = PathSearch(
        2 * reach,
        board.wavelength(room.air),
        max_bounces,
        not no_diffraction,
        edge_strength=edge_strength or EdgeStrength.UNIFORM,
        faintest_diffraction=10 ** (faintest / 20),
    )
    with outputs.text_output(out, force) as file:
        all_paths = paths_from(room, here, search)
        rows = (
            (
                float(all_paths.lengths[k]),
                in_degrees(float(all_paths.departures[k])),
                in_degrees(float(all_paths.arrivals[k])),
                float(all_paths.gains[k]),
                int(all_paths.bounces[k]),
                ">".join(all_paths.via(k, room)),
            )
            for k in range(len(all_paths))
        )
        options.write_rows(file, PATHS_HEADER, rows)


# `sonarhw figures`: draw every figure of the paper, and check the claims of the paper about it.


def figures(
    folder: Annotated[Path, typer.Argument(help="Folder for the pictures and figures.md.", metavar="DIR")],
    picture_format: Annotated[
        Literal["png", "pdf", "svg"], typer.Option("--format", help="Format of the pictures.")
    ] = "png",
    force: options.ForceFiles = False,
) -> None:
    """Draw the paper's figures again and check each. DIR/figures.md states whether each agrees with the paper."""
    from sonarhw_compare.paper.figures import EXHIBITS, PAGE, claims, page, picture, picture_name

    suffix = f".{picture_format}"
    text = folder / PAGE
    pictures = [folder / picture_name(exhibit, suffix) for exhibit in EXHIBITS]
    outputs.refuse_existing_in(folder, [text, *pictures], force, "DIR")
    held = []
    with outputs.made_folder(folder), outputs.progress(len(EXHIBITS), lambda: "Drawing") as advance:
        for exhibit, out in zip(EXHIBITS, pictures, strict=True):
            held += [claim.holds for claim in claims(exhibit)]
            _write_figure(out, picture(exhibit, suffix), force)
            advance()
    _write_figure(text, page(suffix).encode(), force)
    options.print_line(f"{counted(len(pictures), 'figure')}; {sum(held)} of {counted(len(held), 'claim')} hold: {text}")


def _write_figure(out: Path, content: bytes, force: bool) -> None:
    with atomic_file(out, "folder", overwrite=force) as file:
        file.write(content)
