"""The tooltip of a reading: number, heading, measured and predicted range, residual and class."""

from sonarhw_compare.scans import heading_text

from sonarhw_gui.look.appearance import LengthUnit
from sonarhw_gui.look.palette import MARKS
from sonarhw_gui.look.residual_unit import residual_unit
from sonarhw_gui.shown.shown import Shown


def reading_tip(shown: Shown, index: int) -> str:
    """Return the tooltip of a reading, a few short lines."""
    reading, row = shown.readings[index], shown.row(index)
    lines = [f"reading {index} at {heading_text(shown.heading(index))}"]
    lines.append(f"{shown.origin} {_length(reading.range, shown.look.unit)}")
    if row is not None:
        lines.append(f"predicted {_length(row.predicted, shown.look.unit)}")
        if row.residual is not None:
            unit = residual_unit(shown.look.unit)
            lines.append(f"residual {unit.text(row.residual)} {unit.label}")
        if row.kind in MARKS:
            lines.append(f"{MARKS[row.kind].name}: {MARKS[row.kind].meaning}")
    if note := shown.notes.of(index):
        lines.append(f"note: {note}")
    return "\n".join(lines)


def _length(distance: float | None, unit: LengthUnit) -> str:
    return "no echo" if distance is None else unit.text(distance)
