"""`sonarhw simulate`: predict a scan and write it as CSV, NPZ, picture or log."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from sonarhw_compare.film_file import FILMS
from sonarhw_compare.pictures import PICTURES
from sonarhw_sim.air import DEFAULT_BOARD, Model, Unit

from sonarhw.errors import InputError
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
    prediction_rows,
    probability_rows,
    trace_settings,
    write_film_of_sound,
    write_predicted_log,
    write_predicted_npz,
    write_predicted_picture,
)
from sonarhw_cli.prediction.prediction_warnings import warn_of_doubts
from sonarhw_cli.prediction.simulate_checks import PredictionInput, check_input, check_probability

if TYPE_CHECKING:
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.predict.predicted_scan import PredictedScan
    from sonarhw_sim.room.room import Place

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
    unit: FaceEffect = Unit.PASS,
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
    check_probability(probability, model, of_readings, (traces, noise), own_body)
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
    given = PredictionInput(room, here, profile, _headings(order, profile, here), model, options)
    check_input(given, kind, settings)
    scan = _scan_of_spreads(given, pings or 1) if probability else given.scan()
    warn_of_doubts(scan, model)
    if probability:
        with text_output(out, force) as file:
            write_rows(file, PROBABILITY_HEADER, probability_rows(scan, pings, room_tolerance))
    else:
        _write(scan, kind, out, force, settings, room_name)


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
            with text_output(out, force) as file:
                write_rows(file, HEADER, prediction_rows(scan))


def _scan_of_spreads(given: PredictionInput, pings: int) -> "PredictedScan":
    from sonarhw_sim.predict.probability import check_pings, scan_with_fainter_paths

    check_pings(pings)
    board = given.board
    if not board.threshold_sd_db:
        warn(
            f"board profile {board.name!r} has no threshold_sd_db: every echo is either certain or impossible; "
            "write the spread of its threshold into a profile of your own"
        )
    return scan_with_fainter_paths(given.room, given.place, board, given.headings, given.options)


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
