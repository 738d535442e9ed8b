"""`sonarhw fit`: what place, room and board explain one or several logs best, and how sure that is."""

import json
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli.fit_table import figures, lines_of
from cli.log_input import open_log, recorded_place, recorded_room
from cli.numbers import counted
from cli.options import ReceiverChoice, ReceiverName, chosen_receiver
from cli.progress import progress_of_share
from sonarhw.errors import InputError

if TYPE_CHECKING:
    from compare.fit import FitResult, Parameter, PlacedScan
    from sim.room import Room
    from sonarhw.log import Log

NEAR = 0.25  # m: how far from a place that is named the sensor may have stood
_NUMBER = r"([-+]?\d*\.?\d+(?:[eE][-+]?\d+)?)"


def fit(
    log_files: Annotated[list[Path], typer.Argument(help="Logs (*.mcap), whole or torn.", metavar="LOG...")],
    room_file: Annotated[
        Path | None, typer.Option("--room", help="Room file; default: the room inside the first log.", metavar="ROOM")
    ] = None,
    places: Annotated[
        list[str] | None,
        typer.Option(
            "--place", help="Place, or X,Y in metres; once for each log. A free position stays near it.", metavar="P"
        ),
    ] = None,
    board: Annotated[
        str | None, typer.Option(help="Board profile: name or file; default: the log's.", metavar="NAME|FILE.toml")
    ] = None,
    receiver: ReceiverChoice = None,
    free: Annotated[
        str,
        typer.Option(
            help="What the fit may choose: position, heading, offset, axis (ahead, aside), temperature or speed, "
            "threshold, aperture, reflectance[:MATERIAL], wall:NAME, walls.",
            metavar="NAME,...",
        ),
    ] = "position,heading",
    priors: Annotated[
        list[str] | None,
        typer.Option("--prior", help="What is known: NAME=VALUE+-DEVIATION or NAME=LOW..HIGH.", metavar="NAME=..."),
    ] = None,
    samples: Annotated[
        int, typer.Option(help="Drawn to learn how sure the fit is; 0: by its curvature alone.", min=0, max=1_000_000)
    ] = 4000,
    seed: Annotated[int, typer.Option(help="Of those samples.", min=0, max=2**32 - 1)] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False,
) -> None:
    """Find the place, heading, board and room that explain logs best, and how sure that is."""
    result = fit_logs(log_files, room_file, places or [], board, receiver, free, priors or [], samples, seed)
    if as_json:
        typer.echo(json.dumps(figures(result), indent=2))
    else:
        for line in lines_of(result):
            typer.echo(line)


def fit_logs(
    log_files: Sequence[Path],
    room_file: Path | None,
    places: Sequence[str],
    board: str | None,
    receiver: ReceiverName | None,
    free: str,
    priors: Sequence[str],
    samples: int,
    seed: int,
) -> "FitResult":
    """The fit of logs; what is not given is taken from the first of them. Raises InputError where that says nothing."""
    from compare.fit import FitOptions, fit_scans, free_parameters
    from compare.recorded_board import board_of_log
    from sim.board import load_board
    from sim.prediction import PredictionOptions
    from sim.room import load_room

    if places and len(places) != len(log_files):
        raise InputError(f"--place: expected one for each of {counted(len(log_files), 'log')}, got {len(places)}")
    room = None if room_file is None else load_room(room_file)
    logs = [open_log(file) for file in log_files]
    room = room or recorded_room(log_files[0], logs[0].metadata)
    chosen = load_board(board) if board else board_of_log(logs[0].metadata)
    names = _names(log_files)
    words = [word for word in free.split(",") if word.strip()]
    parameters = free_parameters(words, names, room, chosen)
    moving = {parameter.scan for parameter in parameters if parameter.kind in ("x", "y")}
    scans = [
        _placed(file, log, room, places[k] if places else None, names[k], k in moving)
        for k, (file, log) in enumerate(zip(log_files, logs, strict=True))
    ]
    if places:
        parameters = tuple(_near(parameter, scans) for parameter in parameters)
    parameters = with_priors(parameters, priors)
    options = FitOptions(PredictionOptions(receiver=chosen_receiver(receiver, chosen)), seed, samples)
    with progress_of_share() as show:
        return fit_scans(scans, room, chosen, parameters, options=options, progress=show)


def _names(log_files: Sequence[Path]) -> list[str]:
    stems = [file.stem for file in log_files]
    return stems if len(set(stems)) == len(stems) else [f"{stem}{k + 1}" for k, stem in enumerate(stems)]


def _placed(file: Path, log: "Log", room: "Room", wanted: str | None, name: str, moving: bool) -> "PlacedScan":
    from compare.fit import PlacedScan
    from sim.room import Place

    if not log.readings:
        raise InputError(f"{file}: holds no readings; nothing can be fitted")
    here = wanted if wanted is not None else recorded_place(log.metadata, room)
    # where the whole room is searched nobody need say where the sensor stood
    place = Place("", _middle(room)) if here is None and moving else room.place(here)
    return PlacedScan(log.readings, place, name)


def _middle(room: "Room") -> tuple[float, float]:
    ends = room.walls.reshape(-1, 2)
    x, y = ((ends.min(axis=0) + ends.max(axis=0)) / 2).tolist()
    return x, y


def _near(parameter: "Parameter", scans: "Sequence[PlacedScan]") -> "Parameter":
    if parameter.kind not in ("x", "y"):
        return parameter
    at = scans[parameter.scan or 0].place.position[0 if parameter.kind == "x" else 1]
    return replace(parameter, lower=at - NEAR, upper=at + NEAR)


def with_priors(parameters: "Sequence[Parameter]", priors: Sequence[str]) -> "tuple[Parameter, ...]":
    """The parameters with what `--prior` says of them. Raises InputError where it names none or makes no sense."""
    found = list(parameters)
    for prior in priors:
        name, _, text = prior.partition("=")
        rows = [k for k, parameter in enumerate(found) if name in (parameter.name, parameter.kind.value)]
        if not rows:
            known = ", ".join(parameter.name for parameter in parameters)
            raise InputError(f"--prior {prior}: expected NAME=… with one of what is free: {known}")
        for k in rows:
            found[k] = _with_prior(found[k], prior, text)
    return tuple(found)


def _with_prior(parameter: "Parameter", prior: str, text: str) -> "Parameter":
    unit = math.radians(1) if parameter.kind == "heading" else 1.0
    if match := re.fullmatch(rf"{_NUMBER}\s*\.\.\s*{_NUMBER}", text):
        low, high = (float(number) * unit for number in match.groups())
        if low < high:
            return replace(parameter, lower=low, upper=high)
    if match := re.fullmatch(rf"{_NUMBER}\s*(?:\+-|±)\s*{_NUMBER}", text):
        value, deviation = (float(number) * unit for number in match.groups())
        if deviation > 0 and parameter.lower <= value <= parameter.upper:
            return replace(parameter, expected=value, deviation=deviation)
        raise InputError(
            f"--prior {prior}: expected a deviation over 0 and a value from {parameter.lower / unit:g} to "
            f"{parameter.upper / unit:g}"
        )
    raise InputError(f"--prior {prior}: expected NAME=VALUE+-DEVIATION, or NAME=LOW..HIGH with LOW below HIGH")
