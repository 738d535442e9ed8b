"""`sonarhw simulate`: predict a scan and write it as CSV, NPZ, picture or log."""

import math
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli.numbers import write_csv
from cli.options import (
    DEFAULT_BOARD,
    LOG,
    STDOUT,
    BoardName,
    Force,
    FromDegrees,
    PlaceName,
    RoomFile,
    StepDegrees,
    ToDegrees,
    checked_out,
    scan_order,
)
from cli.output import text_output, whole_file

if TYPE_CHECKING:
    from sim.prediction import PredictedScan

HEADER = "heading_deg,range_m,path_m,level_db,bounces,via"
_PING_PERIOD = 0.1  # s; a simulated scan is logged as if taken at the usual pace
_FORMATS = (".csv", ".npz", ".png", LOG, STDOUT)


class Receiver(StrEnum):
    """Which receiver the prediction is made for."""

    FIRST_ECHO = "first-echo"


class UnitChoice(StrEnum):
    """What the transducer's body does to sound that passes it."""

    PASS = "pass"
    BLOCK = "block"


class ModelChoice(StrEnum):
    """The model that predicts."""

    RAY_FOLLOWING = "ray-following"
    NEAREST = "nearest"
    CONE = "cone"
    KUC_SIEGEL = "kuc-siegel"


def simulate(
    room_file: RoomFile,
    place: PlaceName = None,
    start: FromDegrees = 0.0,
    stop: ToDegrees = 360.0,
    step: StepDegrees = 5.0,
    board: BoardName = DEFAULT_BOARD,
    receiver: Annotated[Receiver, typer.Option(help="Receiver.")] = Receiver.FIRST_ECHO,
    unit: Annotated[UnitChoice, typer.Option(help="What the transducer's body does to passing sound.")] = (
        UnitChoice.PASS
    ),
    model: Annotated[ModelChoice, typer.Option(help="Model that predicts.")] = ModelChoice.RAY_FOLLOWING,
    out: Annotated[str, typer.Option(help="FILE.csv, .npz, .png, .mcap, or - for CSV on standard output.")] = "-",
    force: Force = False,
) -> None:
    """Predict a scan: what the board would report at each heading of the room, and by which path."""
    from sim.board import load_board
    from sim.models import Model, predict_with
    from sim.prediction import PredictionOptions, Unit
    from sim.room import load_room

    kind = checked_out(out, _FORMATS, force, room_file, board)
    order = scan_order(start, stop, step)
    room = load_room(room_file)
    here, chosen = room.place(place), load_board(board)
    options = PredictionOptions(unit=Unit(unit.value))
    scan = predict_with(Model(model.value), room, here, chosen, order.angles(), options)
    match kind:
        case ".npz":
            _write_npz(scan, Path(out))
        case ".png":
            _write_picture(scan, Path(out))
        case ".mcap":
            _write_log(scan, room_file.name, Path(out), force)
        case _:
            with text_output(out) as file:
                write_csv(file, HEADER, _rows(scan))


def _rows(scan: "PredictedScan") -> Iterator[tuple[float | int | str | None, ...]]:
    bounces, ranges = scan.paths.bounces, scan.ranges
    for k, (heading, first) in enumerate(zip(scan.headings, scan.first, strict=True)):
        if first < 0:
            yield math.degrees(heading), None, None, None, None, None
            continue
        length, level = float(scan.paths.lengths[first]), float(scan.levels[k, first])
        via = ">".join(scan.paths.via(int(first), scan.room))
        yield math.degrees(heading), float(ranges[k]), length, level, int(bounces[first]), via


def _write_npz(scan: "PredictedScan", out: Path) -> None:
    import numpy as np

    *numbers, via = zip(*_rows(scan), strict=True)
    columns = [np.array(column, dtype=float) for column in numbers] + [np.array([touched or "" for touched in via])]
    with whole_file(out) as file:
        np.savez(file, allow_pickle=False, **dict(zip(HEADER.split(","), columns, strict=True)))


def _write_picture(scan: "PredictedScan", out: Path) -> None:
    from compare.picture import draw_plan

    figure = draw_plan(scan, title=f"{scan.room.name}, place {scan.place.name}, board {scan.board.name}")
    with whole_file(out) as file:
        figure.savefig(file, format="png")


def _write_log(scan: "PredictedScan", room_file: str, out: Path, force: bool) -> None:
    import time

    from sonarhw.encode import write_scan
    from sonarhw.log import LogMetadata
    from sonarhw.readings import Reading

    air = scan.room.air
    readings = [
        Reading(
            number=number,
            sweep=0,
            ping=0,
            angle=float(heading) - scan.place.heading,
            time=number * _PING_PERIOD,
            echo_times=() if math.isnan(distance) else (2 * float(distance) / air.speed_of_sound,),
            speed_of_sound=air.speed_of_sound,
            temperature_c=air.temperature_c,
        )
        for number, (heading, distance) in enumerate(zip(scan.headings, scan.ranges, strict=True))
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
