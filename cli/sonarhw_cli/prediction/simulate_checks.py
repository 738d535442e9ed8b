"""Checks of the options of `sonarhw simulate`: those that exclude each other, or have no effect."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from sonarhw_compare.film_file import FILMS
from sonarhw_sim.air import Model, Receiver, Unit

from sonarhw.errors import InputError
from sonarhw_cli.prediction.predicted_files import TraceForm, TraceSettings, check_trace_size, listening_time

if TYPE_CHECKING:
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.predict.predicted_scan import PredictedScan
    from sonarhw_sim.predict.prediction import PredictionOptions
    from sonarhw_sim.room.room import Place, Room

    from sonarhw.readings import FloatArray


@dataclass(frozen=True)
class PredictionInput:
    """What a scan is predicted from."""

    room: "Room"
    place: "Place"
    board: "Board"
    headings: "FloatArray"  # (n,), rad in the room
    model: Model
    options: "PredictionOptions"

    def scan(self) -> "PredictedScan":
        """Return the prediction by the model."""
        from sonarhw_sim.predict.prediction import predict_with

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
    from sonarhw_compare.film_file import check_film

    if not given.model.follows_sound:
        raise InputError(f"--model {given.model}: a film needs a model that follows sound")
    if len(given.headings) != 1:
        raise InputError(
            f"--out *{suffix}: a film shows one heading, not {len(given.headings)}; "
            "give for example --from 270 --to 271 --step 1"
        )
    check_film(suffix)


def check_probability(
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


def _check_noise(given: PredictionInput, traces: TraceSettings | None) -> None:
    noise, receiver = given.options.noise, given.options.receiver_of(given.board, given.model)
    if not 0 <= noise <= 1:
        raise InputError(f"--noise {noise:g}: expected 0 to 1, which is full scale")
    if noise and traces is None and receiver is Receiver.FIRST_ECHO:
        raise InputError(f"--noise {noise:g}: has no effect without --traces or --receiver board; add one")


def _check_effect(given: PredictionInput) -> None:
    """Raise InputError for options without an effect."""
    model, options, place, board = given.model, given.options, given.place, given.board
    if options.sections > 1 and place.height is None:
        raise InputError(f"--sections {options.sections}: place {place.name!r} has no height; add one to the room file")
    if not model.follows_sound and options.unit is not Unit.PASS:
        raise InputError(f"--unit {options.unit}: has no effect with --model {model}; leave it out")
    if options.grain is not None:
        _check_grain(options.grain, given.room, model)
    if options.own_body and not board.own_body:
        raise InputError(f"--own-body: board {board.name!r} has no own_body; `sonarhw calibrate` finds it from logs")


def _check_grain(grain: int, room: "Room", model: Model) -> None:
    if not room.scattered.any():
        raise InputError(f"--grain {grain}: has no effect: no surface of room {room.name!r} has scatter; leave it out")
    if not model.follows_sound:
        raise InputError(f"--grain {grain}: has no effect with --model {model}; leave it out")
