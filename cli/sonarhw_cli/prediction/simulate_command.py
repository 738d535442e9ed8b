"""`sonarhw simulate`: predict a scan and write it as CSV, NPZ, picture or log."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from sonarhw_compare.pictures.picture_file import PICTURES
from sonarhw_compare.sound.film_file import FILMS
from sonarhw_sim.choices import DEFAULT_BOARD, Model, Receiver, Unit

from sonarhw.errors import InputError
from sonarhw.harmless_text import counted
from sonarhw_cli.console.lines import warn
from sonarhw_cli.console.number_format import write_rows
from sonarhw_cli.console.options import (
    LOG,
    STDOUT,
    BoardName,
    EdgeStrengthChoice,
    Force,
    FromDegrees,
    ModelChoice,
    PingsOfMedian,
    PlaceName,
    ReceiverChoice,
    RoomName,
    RoomTolerance,
    StepDegrees,
    ToDegrees,
    order_in_degrees,
    warn_of_radians,
)
from sonarhw_cli.console.output import checked_out, text_output
from sonarhw_cli.console.room_input import chosen_place, open_room
from sonarhw_cli.prediction.predicted_files import (
    HEADER,
    PROBABILITY_HEADER,
    TraceForm,
    TraceSettings,
    check_trace_size,
    listening_time,
    prediction_rows,
    probability_rows,
    trace_settings,
    write_film_of_sound,
    write_predicted_log,
    write_predicted_npz,
    write_predicted_picture,
)

if TYPE_CHECKING:
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.predict.predicted_scan import PredictedScan
    from sonarhw_sim.predict.prediction import PredictionOptions
    from sonarhw_sim.room.model import Place, Room

    from sonarhw.readings import FloatArray, ScanOrder

WHOLE_CIRCLE = (0.0, 360.0, 5.0)  # degrees: from, to, step
_CSV = (".csv", STDOUT)
_FORMATS = (".csv", ".npz", *PICTURES, LOG, *FILMS, STDOUT)


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
    room_name: RoomName,
    place: PlaceName = None,
    start: FromDegrees = WHOLE_CIRCLE[0],
    stop: ToDegrees = WHOLE_CIRCLE[1],
    step: StepDegrees = WHOLE_CIRCLE[2],
    board: BoardName = DEFAULT_BOARD,
    receiver: ReceiverChoice = None,
    unit: FaceEffect = (Unit.PASS),
    edge_strength: EdgeStrengthChoice = None,
    sections: Sections = 1,
    model: ModelChoice = Model.RAY_FOLLOWING,
    traces: TracesToWrite = None,
    rate: TraceRate = None,
    noise: ReceiverNoise = 0.0,
    seed: RandomSeed = None,
    grain: SpeckleSeed = None,
    probability: AsProbability = False,
    pings: PingsOfMedian = None,
    room_tolerance: RoomTolerance = None,
    own_body: WithOwnBody = False,
    out: PredictionFile = "-",
    force: Force = False,
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

    kind = checked_out(out, _CSV if probability else _FORMATS, force, room_name, board)
    of_readings = {"--pings": pings, "--room-tolerance": room_tolerance}
    _check_probability(probability, model, of_readings, (traces, noise), own_body)
    settings = trace_settings(traces, rate, kind)
    order = order_in_degrees(start, stop, step)
    warn_of_radians(start, stop)
    room, profile = open_room(room_name), load_board(board)
    here = profile.faced(chosen_place(room, place))
    options = PredictionOptions(
        unit=unit,
        edge_strength=edge_strength,
        receiver=receiver,
        noise=noise,
        seed=seed,
        grain=grain,
        sections=sections,
        own_body=own_body,
    )
    asked = _Question(room, here, profile, _headings(order, profile, here), model, options)
    _check_question(asked, kind, settings)
    scan = _scan_of_spreads(asked, pings or 1) if probability else asked.scan()
    _warn_of_doubts(scan, model)
    if probability:
        with text_output(out, force) as file:
            write_rows(file, PROBABILITY_HEADER, probability_rows(scan, pings, room_tolerance))
    else:
        _write(scan, kind, out, force, settings, room_name)


@dataclass(frozen=True)
class _Question:
    """What to predict."""

    room: "Room"
    place: "Place"
    board: "Board"
    headings: "FloatArray"  # (n,), rad in the room
    model: Model
    options: "PredictionOptions"

    def scan(self) -> "PredictedScan":
        from sonarhw_sim.predict.models import predict_with

        return predict_with(self.model, self.room, self.place, self.board, self.headings, self.options)


def _write(
    scan: "PredictedScan", kind: str, out: str, force: bool, settings: TraceSettings | None, room_name: str
) -> None:
    from sonarhw_sim.named_file import file_name

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
            with text_output(out, force) as file:
                write_rows(file, HEADER, prediction_rows(scan))


def _check_question(asked: _Question, kind: str, traces: TraceSettings | None) -> None:
    """Raise InputError for options that exclude each other or have no effect, MissingExtra if a film needs PyAV."""
    _check_noise(asked, traces)
    _check_effect(asked)
    if kind in FILMS:
        _check_film(asked, kind)
    if traces is not None:
        check_trace_size(traces, kind, listening_time(asked.board, asked.room.air), len(asked.headings))


def _check_film(asked: _Question, suffix: str) -> None:
    """Raise InputError if a film is not possible, MissingExtra if it needs PyAV."""
    from sonarhw_compare.sound.film_file import check_film

    if not asked.model.follows_sound:
        raise InputError(f"--model {asked.model}: a film needs a model that follows sound")
    if len(asked.headings) != 1:
        raise InputError(
            f"--out *{suffix}: a film shows one heading, not {len(asked.headings)}; "
            "give for example --from 270 --to 271 --step 1"
        )
    check_film(suffix)


def _check_probability(
    probability: bool,
    model: Model,
    of_readings: dict[str, float | None],
    signal: tuple[TraceForm | None, float],
    own_body: bool,
) -> None:
    """Raise InputError for options that only --probability has, or does not have."""
    if not probability:
        for option, value in of_readings.items():
            if value is not None:
                raise InputError(f"{option} {value:g}: needs --probability")
        return
    if model is not Model.RAY_FOLLOWING:
        raise InputError(f"--probability: needs --model {Model.RAY_FOLLOWING}; {model} states no probability")
    if any(signal):
        raise InputError("--probability: expected neither --traces nor --noise; the board profile states the spreads")
    if own_body:
        raise InputError("--own-body: has no effect with --probability; leave one of them out")


def _scan_of_spreads(asked: _Question, pings: int) -> "PredictedScan":
    from sonarhw_sim.probability.reading_chances import check_pings, scan_with_fainter_paths

    check_pings(pings)
    board = asked.board
    if not board.threshold_sd_db:
        warn(
            f"board profile {board.name!r} has no threshold_sd_db: every echo is either certain or impossible; "
            "write the spread of its threshold into a profile of your own"
        )
    return scan_with_fainter_paths(asked.room, asked.place, board, asked.headings, asked.options)


def _check_noise(asked: _Question, traces: TraceSettings | None) -> None:
    noise, receiver = asked.options.noise, asked.options.receiver_of(asked.board, asked.model)
    if not 0 <= noise <= 1:
        raise InputError(f"--noise {noise:g}: expected 0 to 1, which is full scale")
    if noise and traces is None and receiver is Receiver.FIRST_ECHO:
        raise InputError(f"--noise {noise:g}: has no effect without --traces or --receiver board; add one")


def _check_effect(asked: _Question) -> None:
    """Raise InputError for options without an effect."""
    model, options, place, board = asked.model, asked.options, asked.place, asked.board
    if options.sections > 1 and place.height is None:
        raise InputError(f"--sections {options.sections}: place {place.name!r} has no height; add one to the room file")
    if not model.follows_sound and options.unit is not Unit.PASS:
        raise InputError(f"--unit {options.unit}: has no effect with --model {model}; leave it out")
    if options.grain is not None:
        _check_grain(options.grain, asked.room, model)
    if options.own_body and not board.own_body:
        raise InputError(f"--own-body: board {board.name!r} has no own_body; `sonarhw calibrate` finds it from logs")


def _check_grain(grain: int, room: "Room", model: Model) -> None:
    if not room.scattered.any():
        raise InputError(f"--grain {grain}: has no effect: no surface of room {room.name!r} has scatter; leave it out")
    if not model.follows_sound:
        raise InputError(f"--grain {grain}: has no effect with --model {model}; leave it out")


def _warn_of_doubts(scan: "PredictedScan", model: Model) -> None:
    if model.follows_sound:
        _warn_of_near_field(scan)
    _warn_of_face_outside(scan)
    _warn_of_silence(scan)


def _warn_of_near_field(scan: "PredictedScan") -> None:
    """Warn about readings in the near field, where the directivity of the far field is wrong."""
    import numpy as np
    from sonarhw_sim.board.transducer import far_field

    begins = far_field(scan.board.aperture_radius, scan.board.wavelength(scan.room.air))
    near = int((scan.distances[~np.isnan(scan.distances)] < begins).sum())
    if near:
        warn(
            f"{counted(near, 'reading')} nearer than {begins:.3f} m, where the far field of the "
            "transducer begins: their beam loss is approximate"
        )


def _warn_of_silence(scan: "PredictedScan") -> None:
    """Warn if no heading has an echo, with the reason; that the place is outside the room is printed already."""
    import numpy as np
    from sonarhw_sim.check.no_echo import reason_for_silence

    if np.isnan(scan.ranges).all() and not scan.room.is_outside(scan.place.position):
        warn(f"no echo: {reason_for_silence(scan.room, scan.place, scan.board)}")


def _warn_of_face_outside(scan: "PredictedScan") -> None:
    """Warn if the place is inside the room, but the mount or ring puts the face outside."""
    if scan.board.mounting.turns_about_face or scan.room.is_outside(scan.place.position):
        return
    outside = sum(scan.room.is_outside((x, y)) for x, y in scan.standpoints.tolist())
    if outside:
        warn(
            f"at {counted(outside, 'heading')} of {len(scan.headings)} board {scan.board.name!r} "
            f"has its face outside room {scan.room.name!r}; move the place, or check [mount] or [ring]"
        )


def _headings(order: "ScanOrder", board: "Board", place: "Place") -> "FloatArray":
    """Return the requested headings, or those of the sensors of a ring. Raises InputError if both are given."""
    if board.ring is None:
        return order.angles()
    if order != order_in_degrees(*WHOLE_CIRCLE):
        raise InputError(
            f"board {board.name!r} is a ring of {board.ring.sensors} sensors, which does not turn; "
            "leave out --from, --to and --step"
        )
    return board.ring.headings(place)
