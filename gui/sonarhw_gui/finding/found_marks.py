"""The texts and the drawing of a search for the room."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from sonarhw_compare.pictures import points_at
from sonarhw_compare.scans import in_degrees
from sonarhw_sim.predict.predicted_scan import standpoints

from sonarhw.readings import BoolArray, FloatArray
from sonarhw_gui.finding.find_control import FindState
from sonarhw_gui.finding.find_request import Hypotheses
from sonarhw_gui.look.appearance import LengthUnit
from sonarhw_gui.look.residual_unit import residual_unit
from sonarhw_gui.shown.found_drawing import NO_POINTS, FoundDrawing, NextScan

if TYPE_CHECKING:
    from sonarhw_compare.locate import Pose


def row_texts(state: FindState, unit: LengthUnit) -> list[str]:
    """Return one line for each wall and post: name, size, standard deviations, readings for and against."""
    found = state.hypotheses
    if found is None:
        return []
    texts = []
    for row, support in enumerate(found.supports):
        speaking, against = (sum(int(one.sum()) for one in support.speaking(sign)) for sign in (1, -1))
        parts = (support.name, _size(found, row, unit), _deviations(state, row, unit))
        texts.append(f"{' · '.join(filter(None, parts))}\n{speaking} readings for, {against} against")
    return texts


def drawing_of(state: FindState, row: int) -> FoundDrawing | None:
    """Return what is drawn of a search if the wall or post `row` is selected; -1: none. None: nothing."""
    found = state.hypotheses
    if found is None:
        return None
    walls, posts = found.draft.segments, np.array([(*post.center, post.radius) for post in found.draft.posts])
    posts, number = posts.reshape(-1, 3), row - len(walls)
    chosen = 0 <= row < len(found.supports)
    return FoundDrawing(
        walls,
        posts,
        walls[row : row + 1] if chosen and number < 0 else walls[:0],
        posts[number : number + 1] if chosen and number >= 0 else posts[:0],
        _points(found, found.supports[row].speaking(1)) if chosen else NO_POINTS,
        _points(found, found.supports[row].speaking(-1)) if chosen else NO_POINTS,
        NextScan(state.places[0].position, state.places[0].sectors) if state.places else None,
    )


def next_text(state: FindState, unit: Callable[[float], str]) -> str:
    """Return where to scan next and at which headings; empty if it is not known."""
    if not state.places:
        return ""
    best = state.places[0]
    if best.gain <= 0 or not best.sectors:
        return "" if state.running else "Another scan would make no wall or post more certain."
    x, y = (unit(at) for at in best.position)
    sectors = ", ".join(f"{in_degrees(begin, 0):.0f}° to {in_degrees(end, 0):.0f}°" for begin, end in best.sectors)
    so_far = "Best so far, while other places are tried: s" if state.running else "S"
    return f"{so_far}can next at x {x}, y {y}: gain {best.gain:.1f} nats, most from headings {sectors}."


def poses_text(state: FindState, unit: LengthUnit) -> str:
    """Return the possible poses of each scan that was located, and the scans that were not; empty if there are none."""
    if (answer := state.answer) is None:
        return ""
    lines = [f"{name}: {'; '.join(_pose(one, unit) for one in poses)}" for name, poses in answer.poses.items()]
    lines += [f"⚠ {name} is left out: its pose was not found." for name in answer.left_out]
    return "\n".join(lines)


def _pose(pose: "Pose", unit: LengthUnit) -> str:
    x, y = (unit.text(at) for at in pose.position)
    return f"{pose.probability:.0%} at x {x}, y {y}, {in_degrees(pose.heading, 1):.1f}°"


def _size(found: Hypotheses, row: int, unit: LengthUnit) -> str:
    segments = found.draft.segments
    if row < len(segments):
        x, y, x2, y2 = segments[row]
        return str(unit.text(math.hypot(x2 - x, y2 - y)))
    return f"radius {unit.text(found.draft.posts[row - len(segments)].radius)}"


def _deviations(state: FindState, row: int, unit: LengthUnit) -> str:
    """Return the standard deviations of a wall or post; empty while the search runs."""
    found, answer = state.hypotheses, state.answer
    if found is None or answer is None:
        return ""
    small = residual_unit(unit)

    def length(what: str, which: int, part: int) -> str:
        return f"{answer.deviations[what, which, part] * small.per_metre:.{max(small.decimals, 1)}f} {small.label}"

    keys = list(found.draft.walls)
    if row < len(keys):
        return f"± {length('wall', keys[row], 0)}, ± {math.degrees(answer.deviations['wall', keys[row], 1]):.2f}°"
    name = found.supports[row].name
    number = [support.name for support in answer.hypotheses.supports].index(name) - len(answer.found.draft.walls)
    return f"± {length('post', number, 0)}, ± {length('post', number, 1)}"


def _points(found: Hypotheses, chosen: tuple[BoolArray, ...]) -> FloatArray:
    """Return the points of the chosen readings with an echo, (n, 2) m, at the places of the draft."""
    parts = []
    for scan, place, which in zip(found.scans, found.draft.places, chosen, strict=True):
        readings = [scan.readings[k] for k in np.flatnonzero(which) if scan.readings[k].range is not None]
        if not readings:
            continue
        faced = scan.board.faced(place)
        headings = np.array([faced.heading + scan.board.turned(reading.angle) for reading in readings])
        ranges = np.array([reading.range for reading in readings], dtype=np.float64)
        parts.append(points_at(standpoints(scan.board, faced, headings), headings, ranges))
    return np.vstack(parts) if parts else NO_POINTS
