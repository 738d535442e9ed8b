"""Texts at points of a picture: one for all names at a position, and none over another."""

from collections.abc import Iterable, Sequence
from textwrap import fill

from matplotlib.figure import Figure
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox
from sonarhw_sim.room.room import Place

from sonarhw_compare.pictures.picture_text import picture_text

Point = tuple[float, float]  # m
_MOST = 40  # characters of a line
_BESIDE, _ABOVE = 8, 10  # points, from a mark to its text
# where a text may be: points from the mark, and the alignment there; the first that is free is used
_SIDES = [
    ((_BESIDE, _BESIDE), "left", "bottom"),
    ((_BESIDE, -_BESIDE), "left", "top"),
    ((-_BESIDE, _BESIDE), "right", "bottom"),
    ((-_BESIDE, -_BESIDE), "right", "top"),
    ((0, _ABOVE), "center", "bottom"),
    ((0, -_ABOVE), "center", "top"),
    ((_ABOVE, 0), "left", "center"),
    ((-_ABOVE, 0), "right", "center"),
]


def names_by_position(places: Iterable[Place]) -> dict[Point, str]:
    """Return the text for each position (m) of places: the names there, in the order of the places."""
    found: dict[Point, list[str]] = {}
    for place in places:
        found.setdefault(place.position, []).append(picture_text(place.name))
    return {position: fill(", ".join(names), _MOST) for position, names in found.items()}


def set_apart(figure: Figure, labels: Sequence[Annotation], kept: Sequence[Annotation]) -> None:
    """Move each label of a figure that is laid out to where it covers no earlier one, and nothing that is `kept`.

    A label that covers something everywhere stays at the first side.
    """
    taken = [one.get_window_extent() for one in kept]
    for label in labels:
        boxes = [_put(label, side) for side in range(len(_SIDES))]
        free = [side for side, box in enumerate(boxes) if not any(box.overlaps(other) for other in taken)]
        taken.append(_put(label, free[0] if free else 0))


def _put(label: Annotation, side: int) -> Bbox:
    """Put a label on a side of its point, and return where it then is, in pixels."""
    label.xyann, horizontal, vertical = _SIDES[side]
    label.set(ha=horizontal, va=vertical)
    return label.get_window_extent()
