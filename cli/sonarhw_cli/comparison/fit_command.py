"""`sonarhw fit`: fit place, heading, board and room to one or several logs, with credible intervals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from sonarhw_compare.fit.quantities import QUANTITIES, ROOM_TOLERANCE, BoardQuantity, PlaceQuantity, words_of

from sonarhw.errors import InputError
from sonarhw_cli.comparison.fit_table import fit_figures, fit_lines
from sonarhw_cli.console.lines import print_json, print_line, warn
from sonarhw_cli.console.log_input import LogFiles, open_scan
from sonarhw_cli.console.options import ROOM_NAME, BoardOfLog, Force, ReceiverChoice
from sonarhw_cli.console.output import checked_out, write_text
from sonarhw_cli.console.progress import progress_of_share
from sonarhw_cli.console.room_input import open_room, print_place

if TYPE_CHECKING:
    from sonarhw_compare.fit import FitOptions, FitResult
    from sonarhw_compare.fit.fitting import FitSetting
    from sonarhw_compare.fit.quantities import Parameter
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.room.room import Place, Room


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
        from sonarhw_compare.fit.quantities import present_value

        place = self.setting.scans[parameter.scan or 0].place
        if isinstance(parameter.quantity, PlaceQuantity) and not place.name:
            return None
        return present_value(parameter, place, self.setting.room, self.setting.board)

    def places(self, values: "Mapping[Parameter, float]") -> "tuple[Place, ...]":
        """Return the place of each scan with these values."""
        from sonarhw_compare.fit.quantities import applied

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
    from sonarhw_compare.fit.quantities import check_words
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
    from sonarhw_compare.fit.quantities import quantities_of

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
