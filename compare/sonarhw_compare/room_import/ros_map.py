"""Occupancy grids become walls: maps of ROS, and bitmaps of Stage.

The outline of the occupied cells is divided into straight walls, which are fitted to its points. The notes state how
far the outline lies from these walls.
"""

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from sonarhw_sim.room.room import wall_distances

from sonarhw.errors import InputError, counted
from sonarhw.readings import BoolArray, FloatArray
from sonarhw_compare.room_import.inputs import numbers_of, read_bytes, read_picture
from sonarhw_compare.room_import.plan import ForeignPlan, RoundObject, WallChain

_TOLERANCE = 1.5  # cells, of the outline from a wall before the wall is fitted
_LEVEL = 0.499  # below a half: cells that touch at a corner are one obstacle
_SPECK = 3.0  # cells; the outline of a smaller object does not show its shape
_ROUND = 0.35  # cells, rms of the outline from a circle; cells alone cause 0.29
_MOST_CORNERS = 5  # of an obstacle that is as near to a circle
_LEAST_POST = 0.1  # cells
_PARALLEL = math.sin(math.radians(15.0))  # walls that are nearly in line have no sharp intersection
_FEW = 4  # points of an outline, at least, that a wall is fitted to
_KEY = re.compile(r"^([A-Za-z_]+)\s*:\s*(.*)$")
_ITEM = re.compile(r"^\s*-\s*(.+)$")


@dataclass(frozen=True)
class CellOutlines:
    """Walls in the coordinates of cells: x along columns, y along rows; (0.5, 0.5) is the middle of the first."""

    outlines: list[tuple[FloatArray, bool]]  # points (n, 2), and whether they are closed
    rounds: list[tuple[float, float, float]]  # x, y, radius
    largest: float  # distance of the outline of the cells from the walls
    rms: float


def read_ros_map(file: Path) -> ForeignPlan:
    """Return the plan of a map: a YAML file that names its picture. Raises InputError."""
    keys = _keys(file)
    resolution = _number(file, keys, "resolution")
    occupied_above = _number(file, keys, "occupied_thresh", 0.65)
    free_below = _number(file, keys, "free_thresh", 0.196)
    x, y, yaw = _origin(file, keys)
    if not 1e-4 <= resolution <= 100:
        raise InputError(f"{file}: resolution: expected metres of a cell, got {resolution:g}")
    picture = file.parent / keys["image"]
    bright = read_picture(picture, f"the picture of the map {file.name}")
    mode = keys.get("mode", "trinary")
    occupancy = bright if keys.get("negate", "0").lower() in ("1", "true") else 1.0 - bright
    if mode == "raw":
        occupancy = np.where(bright * 255 <= 100, bright * 2.55, np.nan)
    occupied = np.flipud(occupancy > occupied_above)  # an unknown cell is NaN; the first row is at the top
    free = np.flipud(occupancy < free_below)
    if not occupied.any():
        raise InputError(f"{file}: no cell of {keys['image']} is occupied, above {occupied_above:g}; expected walls")
    turn = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
    plan = plan_of_cells(_filled(occupied, free), resolution, (x, y), turn)
    open_border = _border(free, ~free & ~occupied) * resolution
    if open_border > 0:
        plan.notes.append(f"{open_border:.3g} m of the border of free cells lead to unknown cells and have no wall")
    return plan


def _filled(occupied: BoolArray, free: BoolArray) -> BoolArray:
    """Return the cells with what occupied cells enclose filled, if no free cell is there: no sound enters."""
    from scipy.ndimage import label

    parts, count = label(~occupied)
    is_open = np.zeros(count + 1, np.bool_)
    is_open[np.unique(parts[free])] = True
    for side in (parts[0], parts[-1], parts[:, 0], parts[:, -1]):
        is_open[np.unique(side)] = True
    return np.asarray(occupied | ~is_open[parts])


def plan_of_cells(
    occupied: BoolArray, cell: float, origin: tuple[float, float], turn: FloatArray, name: str = "wall"
) -> ForeignPlan:
    """Return the walls of occupied cells (rows, columns) of `cell` m; `turn` is multiplied from the right."""
    cells = trace_cells(occupied)

    def placed(points: FloatArray) -> FloatArray:
        return np.asarray(points * cell @ turn + origin)

    plan = ForeignPlan()
    for number, (points, closed) in enumerate(cells.outlines):
        plan.outlines.append(WallChain(f"{name} {number}", placed(points), closed))
    for number, (x, y, radius) in enumerate(cells.rounds):
        ((x, y),) = placed(np.array([[x, y]])).tolist()
        plan.rounds.append(RoundObject(f"{name} post {number}", (x, y), radius * cell))
    plan.notes.append(
        f"walls are at most {cells.largest * cell:.3f} m from the outline of the occupied cells, "
        f"{cells.rms * cell:.3f} m rms; a cell is {cell:g} m"
    )
    if cells.rounds:
        plan.notes.append(
            f"{counted(len(cells.rounds), 'obstacle')} that are round, or up to {_SPECK:g} cells, are posts"
        )
    return plan


def trace_cells(occupied: BoolArray) -> CellOutlines:
    """Return the walls along the outline of occupied cells, (rows, columns)."""
    import contourpy

    padded = np.pad(occupied, 1).astype(np.float64)
    rings = contourpy.contour_generator(z=padded).lines(_LEVEL)
    outlines: list[tuple[FloatArray, bool]] = []
    rounds: list[tuple[float, float, float]] = []
    errors: list[FloatArray] = []
    for line in rings:
        ring = np.asarray(line, np.float64)[:-1] - 0.5  # the padding is one cell, the middle of a cell is at 0.5
        corners = _corners(ring)
        points = _fitted(ring, corners)
        apart = _distances(ring, corners, points)
        middle, radius, beside = _circle(ring)
        is_round = _rms(beside) < _ROUND and (len(points) > _MOST_CORNERS or _rms(beside) < _rms(apart))
        if is_round or np.ptp(ring, axis=0).max() <= _SPECK:
            rounds.append((float(middle[0]), float(middle[1]), radius))
            errors.append(beside)
            continue
        outlines.append((points, len(points) > 2))
        errors.append(apart)
    every = np.concatenate(errors) if errors else np.zeros(1)
    return CellOutlines(outlines, _beside_walls(rounds, outlines), float(every.max()), _rms(every))


def _rms(errors: FloatArray) -> float:
    return float(np.sqrt((errors**2).mean()))


def _circle(ring: FloatArray) -> tuple[FloatArray, float, FloatArray]:
    """Return the middle and the mean radius of an outline, and the distances of its points from this circle."""
    middle = ring.mean(axis=0)
    radii = np.hypot(*(ring - middle).T)
    return middle, float(radii.mean()), np.asarray(np.abs(radii - radii.mean()))


def _beside_walls(
    rounds: list[tuple[float, float, float]], outlines: list[tuple[FloatArray, bool]]
) -> list[tuple[float, float, float]]:
    """Return the posts, smaller where they would reach into a wall that was fitted beside them."""
    walls = [WallChain("", points, closed).segments for points, closed in outlines]
    if not walls or not rounds:
        return rounds
    every = np.vstack(walls)
    nearest = [float(wall_distances(np.array([[x, y]]), every).min()) for x, y, _ in rounds]
    return [(x, y, min(r, gap)) for (x, y, r), gap in zip(rounds, nearest, strict=True) if gap > _LEAST_POST]


def _corners(ring: FloatArray) -> list[int]:
    """Return the rows of the corners of a closed outline, by Douglas and Peucker."""
    first = int(((ring - ring.mean(axis=0)) ** 2).sum(axis=1).argmax())
    second = int(((ring - ring[first]) ** 2).sum(axis=1).argmax())
    first, second = sorted((first, second))
    corners, waiting = {first, second}, [(first, second), (second, first + len(ring))]
    while waiting:
        start, stop = waiting.pop()
        between = np.arange(start + 1, stop)
        if not len(between):
            continue
        distances = _from_line(ring[between % len(ring)], ring[start % len(ring)], ring[stop % len(ring)])
        farthest = int(distances.argmax())
        if distances[farthest] > _TOLERANCE:
            middle = int(between[farthest])
            corners.add(middle % len(ring))
            waiting += [(start, middle), (middle, stop)]
    return sorted(corners)


def _from_line(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the distance of points from the segment between two points, (n,)."""
    along = end - start
    share = np.clip((points - start) @ along / (along @ along or 1.0), 0.0, 1.0)
    return np.asarray(np.hypot(*(points - start - share[:, None] * along).T))


def _fitted(ring: FloatArray, corners: list[int]) -> FloatArray:
    """Return the corners where the lines intersect that are fitted to the points between corners, (n, 2)."""
    if len(corners) < 3:
        return ring[corners]
    lines = [_line(ring, start, stop) for start, stop in _walls(corners, len(ring))]
    points = []
    for number, corner in enumerate(corners):
        (middle, along), (other, beside) = lines[number - 1], lines[number]
        cross = along[0] * beside[1] - along[1] * beside[0]
        meeting = ring[corner]
        if abs(cross) > _PARALLEL:
            offset = other - middle
            meeting = middle + along * (offset[0] * beside[1] - offset[1] * beside[0]) / cross
        points.append(meeting if np.hypot(*(meeting - ring[corner])) < 2 * _TOLERANCE else ring[corner])
    return np.array(points)


def _walls(corners: list[int], count: int) -> list[tuple[int, int]]:
    return [*zip(corners, [*corners[1:], corners[0] + count], strict=True)]


def _line(ring: FloatArray, start: int, stop: int) -> tuple[FloatArray, FloatArray]:
    """Return a point of the line between two corners, and its direction."""
    rows = np.arange(start + 1, stop) % len(ring)
    if len(rows) < _FEW:
        rows = np.array([start, stop]) % len(ring)
    points = ring[rows]
    middle = points.mean(axis=0)
    _, _, directions = np.linalg.svd(points - middle, full_matrices=False)
    return middle, directions[0]


def _distances(ring: FloatArray, corners: list[int], points: FloatArray) -> FloatArray:
    """Return the distance of each point of an outline from its wall, (n,)."""
    parts = []
    for number, (start, stop) in enumerate(_walls(corners, len(ring))):
        between = ring[np.arange(start, stop) % len(ring)]
        parts.append(_from_line(between, points[number], points[(number + 1) % len(points)]))
    return np.concatenate(parts)


def _border(one: BoolArray, other: BoolArray) -> int:
    """Return the number of cell sides between cells of two kinds."""
    count = 0
    for first, second in ((one, other), (one.T, other.T)):
        count += int((first[1:] & second[:-1]).sum()) + int((first[:-1] & second[1:]).sum())
    return count


# The YAML of a map has numbers, texts and one list of three numbers.


def _keys(file: Path) -> dict[str, str]:
    try:
        lines = read_bytes(file, "a map of ROS").decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise InputError(f"{file}: is not UTF-8 text; expected the YAML file of a map of ROS") from error
    keys: dict[str, str] = {}
    last = ""
    for line in lines:
        plain = re.sub(r"(^|\s)#.*$", "", line).rstrip()
        if match := _KEY.match(plain):
            last = match[1]
            keys[last] = match[2].strip().strip("'\"")
        elif last and (match := _ITEM.match(plain)):
            keys[last] = f"{keys[last]},{match[1]}".lstrip(",")
        elif last and plain.startswith(" "):
            keys[last] += plain.strip()
    if "image" not in keys or "resolution" not in keys:
        raise InputError(f"{file}: expected the keys image and resolution of a map of ROS")
    return keys


def _number(file: Path, keys: dict[str, str], key: str, default: float | None = None) -> float:
    if key not in keys and default is not None:
        return default
    (number,) = _numbers(file, keys, key, 1)
    return number


def _origin(file: Path, keys: dict[str, str]) -> list[float]:
    return _numbers(file, keys, "origin", 3) if "origin" in keys else [0.0, 0.0, 0.0]


def _numbers(file: Path, keys: dict[str, str], key: str, count: int) -> list[float]:
    numbers = numbers_of(keys[key].strip("[]").split(","), count)
    if numbers is None:
        raise InputError(f"{file}: {key}: expected {counted(count, 'number')} up to 1e9, got {keys[key][:60]!r}")
    return numbers
