"""Output of `sonarhw simulate`: a predicted scan as rows, arrays, picture or log, also with receive signals."""

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
_PING_PERIOD = 0.1  # s between the readings in the log of a predicted scan
_MOST_SAMPLES = 65535  # of a trace in a log


class TraceForm(StrEnum):
    """The form in which receive signals are written."""

    RF = "rf"
    SAMPLED = "sampled"
    ENVELOPE = "envelope"


USUAL_RATES = {TraceForm.RF: 1e6, TraceForm.SAMPLED: 16e6 / 16 / 13, TraceForm.ENVELOPE: 50e3}  # Hz
SLOWEST, FASTEST = 1e3, 1e6  # Hz


@dataclass(frozen=True)
class TraceSettings:
    """The form and rate of the traces to write."""

    kind: TraceForm
    rate: float  # Hz


def trace_settings(kind: TraceForm | None, rate: float | None, suffix: str) -> TraceSettings | None:
    """Return the traces of --traces and --rate. Raises InputError if they do not fit the file format `suffix`."""
    if kind is None:
        if rate is not None:
            raise InputError(f"--rate {rate:g}: needs --traces {', '.join(TraceForm)}")
        return None
    if suffix not in (".npz", LOG) or (suffix == LOG and kind is not TraceForm.ENVELOPE):
        fitting = ".npz or .mcap" if kind is TraceForm.ENVELOPE else ".npz"
        raise InputError(f"--traces {kind.value}: needs a file of format {fitting}; name one with --out")
    chosen = USUAL_RATES[kind] if rate is None else rate
    if not SLOWEST <= chosen <= FASTEST:
        raise InputError(f"--rate {chosen:g}: expected {SLOWEST:g} to {FASTEST:g} Hz")
    return TraceSettings(kind, chosen)


def prediction_rows(scan: "PredictedScan") -> Iterator[tuple[float | int | str | None, ...]]:
    """Yield the columns of HEADER, one row for each heading; None for an unknown value."""
    bounces, ranges = scan.paths.bounces, scan.ranges
    for k, (heading, winner) in enumerate(zip(scan.headings, scan.winners, strict=True)):
        distance = None if math.isnan(ranges[k]) else float(ranges[k])
        if winner < 0:
            yield math.degrees(heading), distance, None, None, None, None
            continue
        # the directivity straight ahead is 1 except for rounding: write 0 dB, not -1e-13
        length, level = float(scan.paths.lengths[winner]), round(float(scan.levels_at(k)[winner]), 9) + 0.0
        via = ">".join(scan.paths.via(int(winner), scan.room))
        yield math.degrees(heading), distance, length, level, int(bounces[winner]), via


def write_predicted_npz(scan: "PredictedScan", traces: TraceSettings | None, out: Path) -> None:
    """Write the columns as arrays; with traces also `trace`, one row for each heading, and `trace_rate_hz`."""
    import numpy as np

    *numbers, via = zip(*prediction_rows(scan), strict=True)
    columns = [np.array(column, dtype=float) for column in numbers] + [np.array([touched or "" for touched in via])]
    named = dict(zip(HEADER.split(","), columns, strict=True))
    if traces is not None:
        named |= {"trace": np.stack([_samples(scan, k, traces) for k in range(len(scan.headings))])}
        named |= {"trace_rate_hz": np.array(traces.rate)}
    with atomic_file(out) as file:
        np.savez(file, allow_pickle=False, **named)


def _samples(scan: "PredictedScan", index: int, traces: TraceSettings) -> "NDArray[np.generic]":
    import numpy as np

    signal = scan.signal_at(index, _listening(scan))
    match traces.kind:
        case TraceForm.RF:
            return signal.rf(traces.rate).astype(np.float32)
        case TraceForm.SAMPLED:
            # counts of the converter: 128 is full scale
            return (signal.sampled(traces.rate) * 128).astype(np.int8)
        case TraceForm.ENVELOPE:
            return signal.envelope(traces.rate).samples.astype(np.float32)


def _listening(scan: "PredictedScan") -> float:
    """Return the listening time of a ping for the range of the board, s."""
    return 2 * scan.board.max_range / scan.room.air.speed_of_sound


def write_predicted_picture(scan: "PredictedScan", out: Path) -> None:
    """Write the plan of the room with the prediction as PNG."""
    from sonarhw_compare.pictures.overlay_picture import draw_plan

    figure = draw_plan(scan, title=f"{scan.room.name}, place {scan.place.name}, board {scan.board.name}")
    with atomic_file(out) as file:
        figure.savefig(file, format="png")


def write_predicted_log(
    scan: "PredictedScan", traces: TraceSettings | None, room_file: str, out: Path, force: bool
) -> None:
    """Write the log of a scanner that measures exactly the prediction. Raises InputError if traces are too long."""
    import time

    from sonarhw.export.encoded_log import write_scan
    from sonarhw.log import LogMetadata
    from sonarhw.readings import Reading

    if traces is not None and math.ceil(_listening(scan) * traces.rate) > _MOST_SAMPLES:
        most = math.floor(_MOST_SAMPLES / _listening(scan))
        raise InputError(
            f"--rate {traces.rate:g}: a trace in a log has at most {_MOST_SAMPLES} samples; give {most} or less"
        )
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


def _echo_times(scan: "PredictedScan", index: int) -> tuple[float, ...]:
    """Return all echo times that the board would report, s; only the first is rounded as the board does."""
    if math.isnan(scan.ranges[index]):
        return ()
    first = 2 * float(scan.ranges[index]) / scan.room.air.speed_of_sound
    return (first, *map(float, scan.echo_times_at(index)[1:]))


def _envelope(scan: "PredictedScan", index: int, traces: TraceSettings) -> "Trace":
    return scan.signal_at(index, _listening(scan)).envelope(traces.rate)
