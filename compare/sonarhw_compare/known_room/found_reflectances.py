"""Reflectances of a room that a calibration finds: their intervals, the room with them, and its text."""

from collections.abc import Sequence

import numpy as np
from sonarhw_sim.room.room import Room, parse_room

from sonarhw.errors import InputError, harmless
from sonarhw_compare.fit.values.quantities import REFLECTANCE, reflectance_of
from sonarhw_compare.known_room.turntable_fit import TurntableFit
from sonarhw_compare.profile_edit import Z95, CalibratedValue

_LEAST_HALF = 0.005  # of an interval; one at a bound has no curvature


def reflectances_of(room: Room, fitted: TurntableFit) -> tuple[CalibratedValue, ...]:
    """Return the reflectances that scans give, with 95 % intervals; `before` is the value of the room file."""
    found = []
    for material, one in fitted.reflectances.items():
        half = max(Z95 * one.deviation, _LEAST_HALF)
        found.append(
            CalibratedValue(
                material, one.value, one.value - half, min(one.value + half, 1.0), reflectance_of(room, material), ""
            )
        )
    return tuple(found)


def with_reflectances(room: Room, found: Sequence[CalibratedValue]) -> Room:
    """Return the room with these reflectances, also in its text. Raises InputError if there are none."""
    if not found:
        raise InputError(
            f"room {room.name!r}: no material has a reflectance that scans can change; "
            "expected one from 0.2 to 1, without a table"
        )
    return REFLECTANCE.write(room, {one.key: float(one.text) for one in found})


def gained_by_reflection(before: Room, after: Room) -> float:
    """Return how much louder one reflection is in a room with other reflectances, dB: the mean along its walls."""
    count = len(before.walls)
    old, new = (np.hypot(room.reflectances, room.scattered)[:count] for room in (before, after))
    lengths = np.hypot(*(before.walls[:, 2:] - before.walls[:, :2]).T) * (old > 0)
    if not lengths.any():
        return 0.0
    return float(np.average(20 * np.log10(np.where(old > 0, new / np.maximum(old, 1e-9), 1.0)), weights=lengths))


def is_contradicted(found: CalibratedValue) -> bool:
    """Return whether the value of the room file is outside the 95 % interval of the scans."""
    return not found.low <= found.before <= found.high


def reflectance_text(found: CalibratedValue) -> str:
    """Return material, reflectance, interval, and the value of the room file, in words."""
    name = harmless(found.key)
    return f"reflectance of {name!r}: {found.text}, 95 % {found.interval_text}; the room file says {found.before:g}"


def with_provenance(room: Room, found: Sequence[CalibratedValue], profile: str, scans: Sequence[str]) -> Room:
    """Return the room with a header that names the `profile` to which it belongs, and the scans."""
    header = [
        f"# Reflectances found by `sonarhw calibrate`, together with board profile {harmless(profile)!r}. "
        "All else is as before.",
        *(f"#   {reflectance_text(one).replace('the room file says', 'before:')}" for one in found),
        f"#   from {', '.join(harmless(scan) for scan in scans)}",
    ]
    return parse_room("\n".join([*header, room.text]), f"room {room.name!r}")
