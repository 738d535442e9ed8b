"""Warnings about a predicted scan: what it approximates, and why it has no echo."""

from typing import TYPE_CHECKING

from sonarhw.errors import counted
from sonarhw_cli.console.lines import warn

if TYPE_CHECKING:
    from sonarhw_sim.air import Model
    from sonarhw_sim.predict.predicted_scan import PredictedScan


def warn_of_doubts(scan: "PredictedScan", model: "Model") -> None:
    """Warn about readings in the near field, a face outside the room, and a scan without an echo."""
    if model.follows_sound:
        _warn_of_near_field(scan)
    _warn_of_face_outside(scan)
    _warn_of_silence(scan)


def _warn_of_near_field(scan: "PredictedScan") -> None:
    """Warn about readings in the near field, where the directivity of the far field is wrong."""
    import numpy as np
    from sonarhw_sim.board.beam import far_field

    begins = far_field(scan.board.aperture_radius, scan.board.wavelength(scan.room.air))
    near = int((scan.distances[~np.isnan(scan.distances)] < begins).sum())
    if near:
        warn(
            f"{counted(near, 'reading')} nearer than {begins:.3f} m, where the far field of the "
            "transducer begins: their beam loss is approximate"
        )


def _warn_of_silence(scan: "PredictedScan") -> None:
    """Warn if no heading has an echo, with the reason; that the place is outside the room is printed already."""
    import numpy as np
    from sonarhw_sim.check import reason_for_silence

    if np.isnan(scan.ranges).all() and not scan.room.is_outside(scan.place.position):
        warn(f"no echo: {reason_for_silence(scan.room, scan.place, scan.board)}")


def _warn_of_face_outside(scan: "PredictedScan") -> None:
    """Warn if the place is inside the room, but the mount or ring puts the face outside."""
    if scan.board.mounting.turns_about_face or scan.room.is_outside(scan.place.position):
        return
    outside = sum(scan.room.is_outside((x, y)) for x, y in scan.standpoints.tolist())
    if outside:
        warn(
            f"at {counted(outside, 'heading')} of {len(scan.headings)} board {scan.board.name!r} "
            f"has its face outside room {scan.room.name!r}; move the place, or check [mount] or [ring]"
        )
