"""Output of `sonarhw simulate`: a predicted scan as rows, arrays, picture or log, also with receive signals."""

import math
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from sonarhw_sim.air import ROOM_TOLERANCE

from sonarhw.errors import InputError
from sonarhw_cli.console.options import LOG
from sonarhw_cli.console.output import print_written, write_figure, written_file

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from sonarhw_sim.air import Air
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.predict.predicted_scan import PredictedScan

    from sonarhw.readings import Trace

PROBABILITY_HEADER = "heading_deg,range_m,probability,via"
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
_SAMPLE_BYTES = {TraceForm.RF: 4, TraceForm.SAMPLED: 1, TraceForm.ENVELOPE: 4}  # in an .npz file
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


def check_trace_size(traces: TraceSettings, suffix: str, listening: float, headings: int) -> None:
    """Raise InputError if traces of `listening` s are too long for a log, or too large together."""
    samples = math.ceil(listening * traces.rate)
    if suffix == LOG and samples > _MOST_SAMPLES:
        most = math.floor(_MOST_SAMPLES / listening)
        raise InputError(
            f"--rate {traces.rate:g}: a trace in a log has at most {_MOST_SAMPLES} samples; give {most} or less"
        )
    sample, most_bytes = (8, _MOST_BYTES_IN_MEMORY) if suffix == LOG else (_SAMPLE_BYTES[traces.kind], _MOST_BYTES)
    needed = headings * samples * sample
    if needed > most_bytes:
        raise InputError(
            f"--traces {traces.kind}: {headings} traces of {samples} samples need {needed / 1e9:.1f} GB, "
            f"at most {most_bytes / 1e9:g} GB are possible; give a larger --step or a lower --rate"
        )


def prediction_rows(scan: "PredictedScan") -> Iterator[tuple[float | int | str | None, ...]]:
    """Yield the columns of HEADER, one row for each heading; None for an unknown value."""
    from sonarhw_sim.board.profile import OWN_BODY

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

    from sonarhw.export import write_array

    *numbers, via = zip(*prediction_rows(scan), strict=True)
    columns = [np.array(column, dtype=float) for column in numbers] + [np.array([touched or "" for touched in via])]
    named = dict(zip(HEADER.split(","), columns, strict=True))
    if traces is not None:
        named |= {"trace_rate_hz": np.array(traces.rate)}
    with written_file(out, overwrite=force) as file, zipfile.ZipFile(file, "w") as archive:
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
        case TraceForm.RF:
            return signal.rf(traces.rate).astype(np.float32)
        case TraceForm.SAMPLED:
            # counts of the converter: 128 is full scale
            return (signal.sampled(traces.rate) * 128).astype(np.int8)
        case TraceForm.ENVELOPE:
            return signal.envelope(traces.rate).samples.astype(np.float32)


def listening_time(board: "Board", air: "Air") -> float:
    """Return the listening time of a ping for the range of the board, s."""
    return 2 * board.max_range / air.speed_of_sound


def _listening(scan: "PredictedScan") -> float:
    return listening_time(scan.board, scan.room.air)


def write_predicted_picture(scan: "PredictedScan", out: Path, force: bool) -> None:
    """Write the plan of the room with the prediction as a picture."""
    from sonarhw_compare.drawings import draw_plan

    title = f"{scan.room.name}, place {scan.place.name}, board {scan.board.name}"
    write_figure(out, draw_plan(scan, title=title), force)


def write_film_of_sound(scan: "PredictedScan", out: Path, suffix: str, force: bool) -> None:
    """Write a film of the sound at the first heading."""
    from sonarhw_compare.film import FilmTiming
    from sonarhw_compare.film_file import write_film
    from sonarhw_compare.sound import PlayedPing

    with written_file(out, overwrite=force) as file:
        write_film(PlayedPing(scan, 0), FilmTiming(), file, suffix)


def write_predicted_log(
    scan: "PredictedScan", traces: TraceSettings | None, room_file: str, out: Path, force: bool
) -> None:
    """Write the log of a scanner that measures exactly the prediction."""
    import time

    from sonarhw.export import write_scan
    from sonarhw.log import LogMetadata
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
    print_written(out)


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
