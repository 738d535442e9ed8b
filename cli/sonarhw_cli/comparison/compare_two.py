"""`sonarhw compare A.mcap --with B.mcap`: two scans by heading, without a room."""

import math
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from sonarhw_compare.pictures import PICTURES
from sonarhw_compare.scans import heading_text, in_degrees

from sonarhw.errors import InputError, counted
from sonarhw_cli.console.lines import print_json, print_line, warn
from sonarhw_cli.console.log_input import open_scan
from sonarhw_cli.console.number_format import write_rows
from sonarhw_cli.console.output import checked_out, text_output, write_figure

if TYPE_CHECKING:
    from sonarhw_compare.scans import GivenScan
    from sonarhw_compare.two_scans import HeadingDifference, HeadingSeries, ScanDifference
    from sonarhw_sim.room.room import Place, Room

_HEADER = "heading_deg,first_m,second_m,difference_m,limit_m,change,first_pings,first_echoes,second_pings,second_echoes"
_APART = 0.02  # m, between places that count as one


def compare_two(
    first_file: Path,
    second_file: Path,
    sweeps: tuple[int | None, int | None],
    *,
    as_json: bool,
    csv: str | None,
    plot: Path | None,
    force: bool,
) -> None:
    """Print the differences of two scans by heading. `sweeps` selects one sweep of each, by default all of them."""
    from sonarhw_compare.drawings import draw_difference
    from sonarhw_compare.two_scans import scan_difference

    if plot is not None:
        checked_out(plot, PICTURES, force, first_file, second_file, option="--plot")
    if csv is not None:
        checked_out(csv, (".csv", "-"), force, first_file, second_file, option="--csv")
    first = open_scan(first_file)
    second = first if second_file == first_file else open_scan(second_file)
    difference = scan_difference(*_series(first, second, sweeps))
    names = _names(first_file, second_file, sweeps)
    if plot is not None:
        write_figure(plot, draw_difference(difference, names), force)
    if csv is not None:
        with text_output(csv, force) as out:
            write_rows(out, _HEADER, map(_row, difference.rows))
    if as_json:
        print_json(_figures(difference))
    elif csv != "-":
        for line in _lines(difference, names):
            print_line(line)


def _series(
    first: "GivenScan", second: "GivenScan", sweeps: tuple[int | None, int | None]
) -> "tuple[HeadingSeries, HeadingSeries]":
    """Return both scans by heading in the room, or by turntable angle if a log contains no place."""
    rooms = [scan.recorded_room for scan in (first, second)]
    names = [room.name for room in rooms if room is not None]
    if len(set(names)) > 1:
        warn(f"the logs contain different rooms, {names[0]!r} and {names[1]!r}; differences show this, too")
    places = [_place(scan, room) for scan, room in zip((first, second), rooms, strict=True)]
    if places[0] is not None and places[1] is not None:
        apart = math.dist(places[0].position, places[1].position)
        if apart > _APART:
            warn(f"the places of the scans are {apart:.2f} m apart; differences by heading show this, too")
        headings = [place.heading for place in places if place is not None]
    else:
        headings = [0.0, 0.0]
    one, other = (_series_of(*given) for given in zip((first, second), headings, sweeps, strict=True))
    return one, other


def _place(scan: "GivenScan", room: "Room | None") -> "Place | None":
    if room is None:
        return None
    wanted = scan.recorded_place(room)
    return None if wanted is None else room.place(wanted)


def _series_of(scan: "GivenScan", heading: float, sweep: int | None) -> "HeadingSeries":
    from sonarhw_compare.two_scans import heading_series

    readings = [reading for reading in scan.readings if sweep is None or reading.sweep == sweep - 1]
    if not readings:
        last = max(reading.sweep for reading in scan.readings) + 1
        raise InputError(f"{scan.where}: has no sweep {sweep}; its sweeps: 1 to {last}")
    return heading_series(readings, scan.board(), heading)


def _names(first: Path, second: Path, sweeps: tuple[int | None, int | None]) -> tuple[str, str]:
    """Return the names of the scans for lines and legends."""
    same_name = first != second and first.name == second.name
    one, other = (
        f"{file if same_name else file.name}{'' if sweep is None else f', sweep {sweep}'}"
        for file, sweep in zip((first, second), sweeps, strict=True)
    )
    return one, other


def _row(row: "HeadingDifference") -> list[float | int | str | None]:
    first, second = row.first, row.second
    values = [in_degrees(row.heading), first.median, second.median, row.difference, row.limit, row.change.value]
    return [*values, first.pings, first.heard, second.pings, second.heard]


def _figures(difference: "ScanDifference") -> dict[str, Any]:
    return {
        "headings": len(difference.rows),
        "unpaired": list(difference.unpaired),
        "median_difference_m": difference.median,
        "noise_m": list(difference.noises),
        "changes": {change.name.lower(): count for change, count in difference.changes.items()},
        "stretches": [
            {
                "change": run[0].change.name.lower(),
                "from_deg": in_degrees(run[0].heading),
                "to_deg": in_degrees(run[-1].heading),
                "headings": len(run),
                "median_difference_m": _median_of(run),
            }
            for run in difference.stretches
        ],
    }


def _median_of(run: "tuple[HeadingDifference, ...]") -> float | None:
    apart = [row.difference for row in run if row.difference is not None]
    return median(apart) if apart else None


def _lines(difference: "ScanDifference", names: tuple[str, str]) -> list[str]:
    found = ", ".join(f"{count} {change.value}" for change, count in difference.changes.items() if count)
    lines = [
        f"first: {names[0]}; second: {names[1]}",
        f"{counted(len(difference.rows), 'heading')} in both: {found}",
    ]
    if difference.median is not None:
        first, second = (f"{noise * 1000:.1f}" for noise in difference.noises)
        lines.append(
            f"second minus first: {difference.median * 1000:+z.1f} mm (median); "
            f"noise of a ping: {first} and {second} mm (standard deviation)"
        )
    for which, lonely in zip(("first", "second"), difference.unpaired, strict=True):
        if lonely:
            lines.append(f"{counted(lonely, 'heading')} of the {which} scan not compared: the other has none near")
    return [*lines, *(_stretch_line(run) for run in difference.stretches)]


def _stretch_line(run: "tuple[HeadingDifference, ...]") -> str:
    where = heading_text(run[0].heading)
    if len(run) > 1:
        where += f" to {heading_text(run[-1].heading)}"
    by = _median_of(run)
    amount = "" if by is None else f" by {abs(by) * 100:.1f} cm{' (median)' if len(run) > 1 else ''}"
    scans = (
        f"{name} {_span([one.median for one in readings if one.median is not None])}"
        for name, readings in (("first", [row.first for row in run]), ("second", [row.second for row in run]))
        if any(one.median is not None for one in readings)
    )
    return f"  {where}: {counted(len(run), 'heading')} {run[0].change.value}{amount}: {', '.join(scans)}"


def _span(ranges: list[float]) -> str:
    """Return the smallest and the largest range of a scan, or both as one if they are equal."""
    least, most = f"{min(ranges):.3f}", f"{max(ranges):.3f}"
    return f"{least} m" if least == most else f"{least} to {most} m"
