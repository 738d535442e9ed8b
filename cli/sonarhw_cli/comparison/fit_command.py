"""`sonarhw fit`: fit place, heading, board and room to one or several logs, with credible intervals."""

import json
import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from sonarhw_compare.fit.values.quantities import QUANTITIES, BoardQuantity, X, Y, words_of
from sonarhw_sim.choices import Receiver

from sonarhw.errors import InputError
from sonarhw_cli.comparison.fit_table import fit_figures, fit_lines
from sonarhw_cli.console.log_input import LogFiles, open_log, recorded_board, recorded_place, recorded_room
from sonarhw_cli.console.number_format import counted
from sonarhw_cli.console.options import BoardOfLog, Force, ReceiverChoice, checked_out, chosen_place, chosen_receiver
from sonarhw_cli.console.output import atomic_file
from sonarhw_cli.console.progress import progress_of_share
from sonarhw_cli.console.room_input import open_room

if TYPE_CHECKING:
    from sonarhw_compare.fit import FitResult, Parameter, PlacedScan
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.room.model import Place, Room

    from sonarhw.log import Log

NEAR = 0.25  # m; a free position is searched within this distance of the place of --place
_NUMBER = r"([-+]?\d*\.?\d+(?:[eE][-+]?\d+)?)"


def fit(
    log_files: LogFiles,
    room_file: Annotated[
        Path | None, typer.Option("--room", help="Room file; default: the room inside the first log.", metavar="ROOM")
    ] = None,
    places: Annotated[
        list[str] | None,
        typer.Option(
            "--place",
            help="Place, or X,Y in metres; once for each log. A free position is searched within 25 cm of it.",
            metavar="P",
        ),
    ] = None,
    board: BoardOfLog = None,
    receiver: ReceiverChoice = None,
    free: Annotated[
        str,
        typer.Option(
            help=f"Quantities to fit: {words_of()}.",
            metavar="NAME,...",
        ),
    ] = "position,heading",
    priors: Annotated[
        list[str] | None,
        typer.Option(
            "--prior",
            help="Prior of a quantity: NAME=VALUE+-DEVIATION (normal) or NAME=LOW..HIGH (bounds).",
            metavar="NAME=...",
        ),
    ] = None,
    samples: Annotated[
        int,
        typer.Option(
            help="Samples drawn for the credible intervals; 0: use the curvature of the likelihood.",
            min=0,
            max=1_000_000,
        ),
    ] = 8000,
    seed: Annotated[int, typer.Option(help="Seed of the samples.", min=0, max=2**32 - 1)] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(help="Write the fitted room: places, materials, walls, air.", metavar="ROOM.toml"),
    ] = None,
    board_out: Annotated[
        Path | None,
        typer.Option(
            help=f"Write the fitted board profile: {words_of(BoardQuantity)}.",
            metavar="BOARD.toml",
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Fit place, heading, board and room to scans. Each value is printed with its credible interval."""
    _check_files(out, board_out, free, force, room_file, board, *log_files)
    fitted = fit_logs(log_files, room_file, places or [], board, receiver, free, priors or [], samples, seed)
    write_fitted(fitted, out, board_out)
    result = fitted.result
    if as_json:
        typer.echo(json.dumps(fit_figures(result), indent=2))
    else:
        for line in fit_lines(result):
            typer.echo(line)


@dataclass(frozen=True)
class FittedLogs:
    """The input of a fit and its result."""

    room: "Room"
    board: "Board"
    scans: "tuple[PlacedScan, ...]"  # at their places before the fit
    result: "FitResult"


def fit_logs(
    log_files: Sequence[Path],
    room_file: Path | None,
    places: Sequence[str],
    board: str | None,
    receiver: Receiver | None,
    free: str,
    priors: Sequence[str],
    samples: int,
    seed: int,
) -> FittedLogs:
    """Fit logs.

    Room, places and board that are not given are taken from the logs. Raises InputError if they do not contain them.
    """
    from sonarhw_compare.fit import FitOptions, PlacedScan, fit_scans, free_parameters
    from sonarhw_sim.board.profile import load_board
    from sonarhw_sim.predict.prediction import PredictionOptions

    if places and len(places) != len(log_files):
        raise InputError(f"--place: expected one for each of {counted(len(log_files), 'log')}, got {len(places)}")
    words = [word for word in free.split(",") if word.strip()]
    _check_words(words, priors)
    room = None if room_file is None else open_room(room_file)
    wanted = [] if room is None else [chosen_place(room, place) for place in places]
    given = load_board(board) if board else None
    logs = [_open(file) for file in log_files]
    room = room or _common_room(log_files, logs)
    chosen = given or _common_board(log_files, logs)
    wanted = wanted or [chosen_place(room, place) for place in places]
    names = _names(log_files)
    parameters = free_parameters(words, names, room, chosen)
    kinds = {parameter.quantity.name for parameter in parameters}
    scans = [
        PlacedScan(log.readings, wanted[k] if wanted else _recorded(file, log, room, kinds), names[k])
        for k, (file, log) in enumerate(zip(log_files, logs, strict=True))
    ]
    if places:
        parameters = tuple(_near(parameter, scans) for parameter in parameters)
    parameters = with_priors(parameters, priors)
    options = FitOptions(PredictionOptions(receiver=chosen_receiver(receiver, chosen)), seed, samples)
    with progress_of_share() as show:
        result = fit_scans(scans, room, chosen, parameters, options=options, progress=show)
    return FittedLogs(room, chosen, tuple(scans), result)


def _check_files(out: Path | None, board_out: Path | None, free: str, force: bool, *inputs: str | Path | None) -> None:
    """Raise InputError if a file cannot be written, or would contain no fitted value."""
    if out is None and board_out is None:
        return
    from sonarhw_compare.fit.values.parameters import quantities_of

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


def write_fitted(fitted: FittedLogs, out: Path | None, board_out: Path | None) -> None:
    """Write the fitted room and the fitted board profile to the given files.

    A place of the room keeps its name. A place that is not in the room, or that several logs have, gets the name of its
    log.
    """
    from sonarhw_compare.fit.findings import found_board, found_room

    values = {one: fitted.result.estimates[one.name].value for one in fitted.result.parameters}
    texts = []
    if out is not None:
        names = [scan.place.name for scan in fitted.scans]
        own = {name for name in fitted.room.places if names.count(name) == 1}
        places = [
            replace(place, name=scan.place.name if scan.place.name in own else scan.name)
            for place, scan in zip(fitted.result.places, fitted.scans, strict=True)
        ]
        texts.append((out, "--out", found_room(fitted.room, values, places).text))
    if board_out is not None:
        deviations = {one: fitted.result.estimates[one.name].deviation for one in values}
        logs = [scan.name for scan in fitted.scans]
        profile = found_board(fitted.board, values, board_out.stem, deviations, logs)
        texts.append((board_out, "--board-out", profile.text))
    for file, option, text in texts:
        with atomic_file(file, option) as written:
            written.write(text.encode())


def _check_words(words: Sequence[str], priors: Sequence[str]) -> None:
    """Raise InputError for errors in `--free` and `--prior`. Reading the logs first could take seconds."""
    from sonarhw_compare.fit.values.parameters import quantities_of

    free = [quantity.name for word in words for quantity in quantities_of(word)]
    for prior in priors:
        name, _, text = prior.partition("=")
        if free and re.split("[:@]", name)[0] not in free:
            listed = ", ".join(free)
            raise InputError(f"--prior {prior}: {name} is not free; add it to --free, or use one of {listed}")
        if _range_of(text) is None and _normal_of(text) is None:
            raise _malformed_prior(prior)


def _open(file: Path) -> "Log":
    log = open_log(file)
    if not log.readings:
        raise InputError(f"{file}: contains no readings; nothing to fit")
    return log


def _common_room(log_files: Sequence[Path], logs: "Sequence[Log]") -> "Room":
    """Return the room inside the logs. Raises InputError if there is none, or if they have different ones."""
    room = recorded_room(log_files[0], logs[0].metadata)
    for file, log in zip(log_files, logs, strict=True):
        if log.metadata.room_text not in ("", logs[0].metadata.room_text):
            raise InputError(f"{log_files[0]} and {file} contain different rooms; give one room for both with --room")
    return room


def _common_board(log_files: Sequence[Path], logs: "Sequence[Log]") -> "Board":
    """Return the board of the logs. Raises InputError if they have different ones."""
    boards = [recorded_board(file, log.metadata) for file, log in zip(log_files, logs, strict=True)]
    for file, board in zip(log_files, boards, strict=True):
        if board != boards[0]:
            raise InputError(
                f"{log_files[0]} and {file} were recorded with different boards; give one for both with --board"
            )
    return boards[0]


def _names(log_files: Sequence[Path]) -> list[str]:
    stems = [file.stem for file in log_files]
    return stems if len(set(stems)) == len(stems) else [f"{stem}{k + 1}" for k, stem in enumerate(stems)]


def _recorded(file: Path, log: "Log", room: "Room", free: Collection[str]) -> "Place":
    """Return the place of a log. Raises InputError if it is unknown although x or y is fixed."""
    from sonarhw_sim.room.model import Place

    recorded = recorded_place(log.metadata, room)
    if recorded is not None:
        return chosen_place(room, recorded)
    fixed = [name for name in ("x", "y") if name not in free]
    if not fixed:
        # the whole room is searched, so the place may be unknown
        return Place("", _middle(room))
    if len(room.places) == 1:
        return room.place(None)
    reason = f"{' and '.join(fixed)} {'is' if len(fixed) == 1 else 'are'} fixed"
    raise InputError(f"{file}: its place is unknown, and {reason}; give --place X,Y, or --free position")


def _middle(room: "Room") -> tuple[float, float]:
    ends = room.walls.reshape(-1, 2)
    x, y = ((ends.min(axis=0) + ends.max(axis=0)) / 2).tolist()
    return x, y


def _near(parameter: "Parameter", scans: "Sequence[PlacedScan]") -> "Parameter":
    if parameter.quantity not in (X, Y):
        return parameter
    at = scans[parameter.scan or 0].place.position[0 if parameter.quantity is X else 1]
    return replace(parameter, lower=at - NEAR, upper=at + NEAR)


def with_priors(parameters: "Sequence[Parameter]", priors: Sequence[str]) -> "tuple[Parameter, ...]":
    """Return the parameters with their priors. Raises InputError for an unknown name or an invalid prior."""
    found = list(parameters)
    for prior in priors:
        name, _, text = prior.partition("=")
        rows = [k for k, parameter in enumerate(found) if name in (parameter.name, parameter.quantity.name)]
        if not rows:
            known = ", ".join(parameter.name for parameter in parameters)
            raise InputError(f"--prior {prior}: expected NAME=… with a free quantity: {known}")
        for k in rows:
            found[k] = _with_prior(found[k], prior, text)
    return tuple(found)


def _with_prior(parameter: "Parameter", prior: str, text: str) -> "Parameter":
    unit = 1 / parameter.quantity.per_unit
    if bounds := _range_of(text):
        return replace(parameter, lower=bounds[0] * unit, upper=bounds[1] * unit)
    if normal := _normal_of(text):
        value, deviation = normal[0] * unit, normal[1] * unit
        if deviation > 0 and parameter.lower <= value <= parameter.upper:
            return replace(parameter, expected=value, deviation=deviation)
        bounded = math.isfinite(parameter.lower) and math.isfinite(parameter.upper)
        where = f" and a value from {parameter.lower / unit:g} to {parameter.upper / unit:g}" if bounded else ""
        raise InputError(f"--prior {prior}: expected a deviation above 0{where}")
    raise _malformed_prior(prior)


def _range_of(text: str) -> tuple[float, float] | None:
    match = re.fullmatch(rf"{_NUMBER}\s*\.\.\s*{_NUMBER}", text)
    if match is None or float(match[1]) >= float(match[2]):
        return None
    return float(match[1]), float(match[2])


def _normal_of(text: str) -> tuple[float, float] | None:
    match = re.fullmatch(rf"{_NUMBER}\s*(?:\+-|±)\s*{_NUMBER}", text)
    return (float(match[1]), float(match[2])) if match else None


def _malformed_prior(prior: str) -> InputError:
    return InputError(f"--prior {prior}: expected NAME=VALUE+-DEVIATION, or NAME=LOW..HIGH with LOW below HIGH")
