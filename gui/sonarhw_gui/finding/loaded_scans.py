"""The scans of the window that a search for the room uses: the one shown, and the visible ones of the panel Scans."""

from collections.abc import Iterable
from dataclasses import replace

from sonarhw_sim.board.profile import without_own_body

from sonarhw.readings import Reading
from sonarhw_gui.finding.find_request import LoadedScan
from sonarhw_gui.scene.scene import NOWHERE, Scene
from sonarhw_gui.shown.shown import Shown

MOST_READINGS = 360  # of a scan, the newest ones; the time of a search is proportional to their number


def loaded_scans(shown: Shown, name: str) -> tuple[LoadedScan, ...]:
    """Return the scan shown, which gets `name`, and the visible scans drawn over it. Without readings, it is omitted.

    A scan shown of which the list has a part, such as a sweep, is omitted too.
    """
    listed = [one for one in shown.overlays if one.visible and one.readings]
    is_listed = any(share_readings(one.readings, shown.readings) for one in listed)
    scans = [] if is_listed or not shown.readings else [_loaded(name, shown.readings, shown.scene)]
    scans += [_loaded(one.name, one.readings, one.scene) for one in listed]
    first = next((scan for scan in scans if scan.known), None)
    ordered = scans if first is None else [first, *(scan for scan in scans if scan is not first)]
    return tuple(_with_own_names(ordered))


def share_readings(one: tuple[Reading, ...], other: tuple[Reading, ...]) -> bool:
    """Return whether two scans have a common reading, the same object."""
    return not {id(reading) for reading in one}.isdisjoint(id(reading) for reading in other)


def _loaded(name: str, readings: tuple[Reading, ...], scene: Scene) -> LoadedScan:
    known = scene.place is not None
    of_room = tuple(without_own_body(scene.board.own_body, readings))  # as the search counts them
    return LoadedScan(name, of_room[-MOST_READINGS:], scene.place or NOWHERE, scene.board, known)


def _with_own_names(scans: Iterable[LoadedScan]) -> Iterable[LoadedScan]:
    """Yield scans, with a number behind a name that another one has already."""
    used: set[str] = set()
    for scan in scans:
        name, number = scan.name or "scan", 2
        while name in used:
            name, number = f"{scan.name or 'scan'} {number}", number + 1
        used.add(name)
        yield replace(scan, name=name)
