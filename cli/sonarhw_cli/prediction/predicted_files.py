"""What `sonarhw simulate` writes: a predicted scan as rows, arrays, picture or log, and the receive signals with it.

Takes a `PredictedScan` and, where traces are wanted, a `TraceWish`; hands on files.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

from sonarhw.errors import InputError
from sonarhw_cli.console.options import LOG
from sonarhw_cli.console.output import atomic_file

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from sonarhw_sim.predict.predicted_scan import PredictedScan

    from sonarhw.readings import Trace

HEADER = "heading_deg,range_m,path_m,level_db,bounces,via"
_PING_PERIOD = 0.1  # s; a simulated scan is logged as if taken at the usual pace
_MOST_SAMPLES = 65535  # of a trace in a log


class TraceForm(StrEnum):
    """What of the receive signal is kept."""

    RF = "rf"
    SAMPLED = "sampled"
    ENVELOPE = "envelope"


USUAL_RATES = {TraceForm.RF: 1e6, TraceForm.SAMPLED: 16e6 / 16 / 13, TraceForm.ENVELOPE: 50e3}  # Hz
SLOWEST, FASTEST = 1e3, 1e6  # Hz


@dataclass(frozen=True)
class TraceWish:
    """Which traces are wanted."""

    kind: TraceForm
    rate: float  # Hz


def trace_wish(kind: TraceForm | None, rate: float | None, ending: str) -> TraceWish | None:
    """The traces that --traces and --rate ask for. Raises InputError where they do not fit the format `ending`."""
    if kind is None:
        if rate is not None:
            raise InputError(f"--rate {rate:g}: is the rate of --traces; name what to keep of them")
        return None
    if ending not in (".npz", LOG) or (ending == LOG and kind is not TraceForm.ENVELOPE):
        fitting = ".npz or .mcap" if kind is TraceForm.ENVELOPE else ".npz"
        raise InputError(f"--traces {kind.value}: are kept in {fitting}; name such a file with --out")
    wanted = USUAL_RATES[kind] if rate is None else rate
    if not SLOWEST <= wanted <= FASTEST:
        raise InputError(f"--rate {wanted:g}: expected {SLOWEST:g} to {FASTEST:g} Hz")
    return TraceWish(kind, wanted)


def prediction_rows(scan: "PredictedScan") -> Iterator[tuple[float | int | str | None, ...]]:
    """The columns of HEADER, one row a heading; None where there is no echo, or no path that made it."""
    bounces, ranges = scan.paths.bounces, scan.ranges
    for k, (heading, winner) in enumerate(zip(scan.headings, scan.winners, strict=True)):
        distance = None if math.isnan(ranges[k]) else float(ranges[k])
        if winner < 0:
            yield math.degrees(heading), distance, None, None, None, None
            continue
        # straight ahead the beam is 1 but for rounding: 0 dB, not -1e-13
        length, level = float(scan.paths.lengths[winner]), round(float(scan.levels_at(k)[winner]), 9) + 0.0
        via = ">".join(scan.paths.via(int(winner), scan.room))
        yield math.degrees(heading), distance, length, level, int(bounces[winner]), via


def write_predicted_npz(scan: "PredictedScan", wish: TraceWish | None, out: Path) -> None:
    """The columns as arrays; with traces `trace`, one row a heading, and `trace_rate_hz`."""
    import numpy as np

    *numbers, via = zip(*prediction_rows(scan), strict=True)
    columns = [np.array(column, dtype=float) for column in numbers] + [np.array([touched or "" for touched in via])]
    named = dict(zip(HEADER.split(","), columns, strict=True))
    if wish is not None:
        named |= {"trace": np.stack([_samples(scan, k, wish) for k in range(len(scan.headings))])}
        named |= {"trace_rate_hz": np.array(wish.rate)}
    with atomic_file(out) as file:
        np.savez(file, allow_pickle=False, **named)


def _samples(scan: "PredictedScan", index: int, wish: TraceWish) -> "NDArray[np.generic]":
    import numpy as np

    signal = scan.signal_at(index, _listening(scan))
    match wish.kind:
        case TraceForm.RF:
            return signal.rf(wish.rate).astype(np.float32)
        case TraceForm.SAMPLED:
            # as the converter counts: 128 is full scale
            return (signal.sampled(wish.rate) * 128).astype(np.int8)
        case TraceForm.ENVELOPE:
            return signal.envelope(wish.rate).samples.astype(np.float32)


def _listening(scan: "PredictedScan") -> float:
    """How long a ping listens, s: as far as the board's range goes."""
    return 2 * scan.board.max_range / scan.room.air.speed_of_sound


def write_predicted_picture(scan: "PredictedScan", out: Path) -> None:
    """The plan with what is predicted, as PNG."""
    from sonarhw_compare.pictures.overlay_picture import draw_plan

    figure = draw_plan(scan, title=f"{scan.room.name}, place {scan.place.name}, board {scan.board.name}")
    with atomic_file(out) as file:
        figure.savefig(file, format="png")


def write_predicted_log(scan: "PredictedScan", wish: TraceWish | None, room_file: str, out: Path, force: bool) -> None:
    """A log as a scanner's that heard just this. Raises InputError where its traces are longer than a log carries."""
    import time

    from sonarhw.export.encoded_log import write_scan
    from sonarhw.log import LogMetadata
    from sonarhw.readings import Reading

    if wish is not None and math.ceil(_listening(scan) * wish.rate) > _MOST_SAMPLES:
        most = math.floor(_MOST_SAMPLES / _listening(scan))
        raise InputError(f"--rate {wish.rate:g}: a log carries {_MOST_SAMPLES} samples of a trace; take {most} or less")
    air = scan.room.air
    readings = [
        Reading(
            number=number,
            sweep=0,
            ping=0,
            angle=float(heading) - scan.place.heading,
            time=number * _PING_PERIOD,
            echo_times=_echo_times(scan, number),
            speed_of_sound=air.speed_of_sound,
            temperature_c=air.temperature_c,
            trace=None if wish is None else _envelope(scan, number, wish),
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


def _echo_times(scan: "PredictedScan", index: int) -> tuple[float, ...]:
    """All that would be reported, the first as the board rounds it."""
    if math.isnan(scan.ranges[index]):
        return ()
    first = 2 * float(scan.ranges[index]) / scan.room.air.speed_of_sound
    return (first, *map(float, scan.echo_times_at(index)[1:]))


def _envelope(scan: "PredictedScan", index: int, wish: TraceWish) -> "Trace":
    return scan.signal_at(index, _listening(scan)).envelope(wish.rate)
