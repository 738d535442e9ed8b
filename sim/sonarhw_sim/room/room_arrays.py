"""Rooms from arrays and shapes: polygons, segments and posts become the text of a room file, and its room."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from sonarhw import arguments
from sonarhw.errors import InputError, counted, smaller_unit
from sonarhw.readings import FloatArray
from sonarhw_sim.room.room import Place, Room, parse_room, place_at
from sonarhw_sim.room.room_file import MAX_COORDINATE, MEETING
from sonarhw_sim.room.room_writing import changed_room

Reflectances: TypeAlias = float | ArrayLike | Mapping[str, float]

REFLECTANCE = 0.95  # of a hard wall, as in the shipped rooms
_LARGE = 100.0  # m; a larger room is probably not in metres
_USUAL = 20.0  # m, the largest usual room
_WALLS = "a polygon (n, 2), segments (n, 2, 2), a list or mapping of these, or an object with __geo_interface__"
_POSTS = "x, y and radius in metres"


@arguments.checked(name=arguments.text, closed=arguments.flag, temperature_c=arguments.number(-40, 60, "°C"))
def room_from_arrays(
    walls: ArrayLike | Sequence[ArrayLike] | Mapping[str, ArrayLike] | Any,
    posts: ArrayLike | Mapping[str, ArrayLike] = (),
    *,
    places: Mapping[str, ArrayLike] | None = None,
    reflectances: Reflectances = REFLECTANCE,
    closed: bool = True,
    temperature_c: float = 20.0,
    name: str = "room",
) -> Room:
    """Return a room of walls and posts; all lengths in m, angles in rad counter-clockwise from x.

    `walls` are a polygon (n, 2), which `closed` closes, or segments (n, 2, 2), or a list or a mapping by name of
    several of these, or an object with `__geo_interface__`, such as one of shapely. Segments that meet form corners.
    `posts` (m, 3) are x, y and radius, or a mapping by name. `places` have x and y, and no heading or one, by name.
    `reflectances` are amplitude ratios from 0 to 1: one for all, one for each segment in order (k,), or some by name of
    wall or post, with 0.95 for the others. Walls without a name are `wall` or `wall 0`, `wall 1`, and their segments
    `wall[0]`, `wall[1]`. Raises InputError. Warns if the room is so large that it is probably in centimetres.
    """
    chains = [*_chains(walls, closed)]
    if not chains:
        raise arguments.refusal("walls", _WALLS, walls)
    rounds = [*_posts(posts)]
    by_segment, by_name = _reflectances(reflectances, chains, [post for post, _ in rounds])
    if by_segment is not None:
        chains = [*_single(chains)]
    lines = [f"name = {json.dumps(name)}", "[air]", f"temperature_c = {temperature_c!r}"]
    of_chain = by_segment if by_segment is not None else [by_name.get(chain, REFLECTANCE) for chain, _, _ in chains]
    of_post = [by_name.get(post, by_name.get("", REFLECTANCE)) for post, _ in rounds]
    if "" in by_name:
        of_chain = [by_name[""]] * len(chains)
    for value in sorted({*of_chain, *of_post}):
        lines += [f"[materials.{json.dumps(_material(value))}]", f"reflectance = {value!r}"]
    for (chain, points, is_closed), value in zip(chains, of_chain, strict=True):
        lines += ["[[walls]]", f"name = {json.dumps(chain)}", f"points = {points.tolist()}"]
        lines += [f"closed = {json.dumps(is_closed)}", f"material = {json.dumps(_material(value))}"]
        if len(points) == 2:
            lines += [f"edges = [{json.dumps(chain)}]"]
    for (post, (x, y, radius)), value in zip(rounds, of_post, strict=True):
        lines += ["[[posts]]", f"name = {json.dumps(post)}", f"center = [{x!r}, {y!r}]", f"radius = {radius!r}"]
        lines += [f"material = {json.dumps(_material(value))}"]
    for place in _places(places):
        lines += [f"[places.{json.dumps(place.name)}]", f"position = {[*place.position]}"]
        degrees = math.degrees(place.heading)
        exact = math.radians(round(degrees, 9)) == place.heading
        lines += [f"heading_deg = {round(degrees, 9) if exact else degrees!r}"]
    text = "\n".join(lines).replace("\n[", "\n\n[")  # an empty line before each table
    room = parse_room(f"{text}\n", "room from arrays")
    _warn_of_centimetres(room)
    return room


def rectangular_room(width: float, depth: float, place: Sequence[float] | None = None, *, name: str = "room") -> Room:
    """Return a room of four walls from (0, 0) to (`width`, `depth`), m, with a place `scanner` for the sensor in it.

    The walls are `south`, `east`, `north` and `west`.
    `place` is x and y, m, or x, y and heading, rad; None: the middle. Raises InputError.
    """
    if not (0 < width <= MAX_COORDINATE and 0 < depth <= MAX_COORDINATE):
        raise InputError(f"room of {width} x {depth}: expected lengths above 0 and up to {MAX_COORDINATE:g} m")
    pose = (width / 2, depth / 2) if place is None else place
    if not (0 < pose[0] < width and 0 < pose[1] < depth):
        raise InputError(f"place {pose[0]:g},{pose[1]:g}: expected a point in the room, 0,0 to {width:g},{depth:g}")
    corners = [[0.0, 0.0], [width, 0.0], [width, depth], [0.0, depth]]
    room = room_from_arrays({"boundary": corners}, places={"scanner": pose}, name=name)
    return changed_room(room, lambda document: document["walls"][0].update(edges=["south", "east", "north", "west"]))


def _material(reflectance: float) -> str:
    return f"reflectance {reflectance:g}"


# walls: chains with name, corners (n, 2) and whether they are closed


_Chain: TypeAlias = tuple[str, FloatArray, bool]


def _chains(walls: Any, closed: bool, name: str = "wall") -> Iterator[_Chain]:
    if hasattr(walls, "__geo_interface__"):
        walls = walls.__geo_interface__
    if isinstance(walls, Mapping) and "type" in walls:
        yield from _numbered(_lines(walls), name)
        return
    if isinstance(walls, Mapping):
        for key, part in walls.items():
            if not isinstance(key, str):
                raise arguments.refusal("walls", "names of walls as keys", key)
            yield from _chains(part, closed, key)
        return
    points = _points(walls)
    if points is not None:
        yield from _of_points(points, closed, name)
        return
    if isinstance(walls, str) or not isinstance(walls, Sequence):
        raise arguments.refusal("walls", _WALLS, walls)
    for number, part in enumerate(walls):
        yield from _chains(part, closed, f"{name} {number}")


def _points(walls: Any) -> FloatArray | None:
    """Return numbers as an array; None if they are several arrays, or no numbers."""
    try:
        return arguments.numbers_in("walls", walls, _WALLS)
    except InputError:
        return None


def _of_points(points: FloatArray, closed: bool, name: str) -> Iterator[_Chain]:
    if points.ndim == 2 and points.shape[1] == 4:
        points = points.reshape(-1, 2, 2)
    if points.ndim not in (2, 3) or points.shape[1:] not in ((2,), (2, 2)) or not len(points):
        raise arguments.refusal("walls", _WALLS, points)
    if not np.isfinite(points).all():
        raise InputError(f"walls: expected finite coordinates in metres, got {points[~np.isfinite(points)][0]:g}")
    if points.ndim == 3:
        yield from _numbered([(segment, False) for segment in points], name)
        return
    if len(points) > 2 and np.hypot(*(points[0] - points[-1])) <= MEETING:
        points, closed = points[:-1], True
    if len(points) < 2:
        raise arguments.refusal("walls", "two points or more", points)
    yield name, points, closed and len(points) > 2


def _numbered(
    lines: Sequence[tuple[FloatArray, bool]] | Iterator[tuple[FloatArray, bool]], name: str
) -> Iterator[_Chain]:
    lines = [*lines]
    for number, (points, closed) in enumerate(lines):
        yield (name if len(lines) == 1 else f"{name}[{number}]"), points, closed


def _lines(shape: Any) -> Iterator[tuple[FloatArray, bool]]:
    """Yield the lines of a GeoJSON shape, each with whether it is closed."""
    kind = str(shape.get("type")) if isinstance(shape, Mapping) else ""
    inner = {"Feature": [shape.get("geometry")], "FeatureCollection": shape.get("features")}.get(kind)
    inner = shape.get("geometries") if kind == "GeometryCollection" else inner
    if inner is not None:
        for part in inner:
            yield from _lines(getattr(part, "__geo_interface__", part))
        return
    depth = {"LineString": 0, "LinearRing": 0, "MultiLineString": 1, "Polygon": 1, "MultiPolygon": 2}.get(kind)
    if depth is None:
        raise InputError(f"walls: expected a shape of lines or polygons, got {kind!r}; give points as `posts`")
    yield from _rings(shape.get("coordinates"), depth)


def _rings(coordinates: Any, depth: int) -> Iterator[tuple[FloatArray, bool]]:
    if depth:
        for part in coordinates:
            yield from _rings(part, depth - 1)
        return
    points = arguments.numbers_in("walls", coordinates, "coordinates of a shape, (n, 2)")
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise arguments.refusal("walls", "coordinates of a shape, (n, 2)", points)
    for _, line, closed in _of_points(points[:, :2], False, ""):
        yield line, closed


def _single(chains: Sequence[_Chain]) -> Iterator[_Chain]:
    """Yield each segment of the chains as a chain of its own."""
    for name, points, closed in chains:
        ends = np.roll(points, -1, axis=0) if closed else points[1:]
        count = len(ends)
        for number, (start, end) in enumerate(zip(points, ends, strict=False)):
            yield (name if count == 1 else f"{name}[{number}]"), np.array([start, end]), False


def _posts(posts: Any) -> Iterator[tuple[str, list[float]]]:
    if isinstance(posts, Mapping):
        for name, post in posts.items():
            yield str(name), arguments.rows("posts", post, (3,), _POSTS)[0].tolist()
        return
    for number, post in enumerate(arguments.rows("posts", posts, (3,), _POSTS).tolist()):
        yield f"post[{number}]", post


def _places(places: Mapping[str, Any] | None) -> Iterator[Place]:
    if places is not None and not isinstance(places, Mapping):
        raise arguments.refusal("places", "x and y by name of the place", places)
    for name, pose in (places or {}).items():
        place = pose if isinstance(pose, Place) else place_at("places", pose)
        yield Place(str(name), place.position, place.heading)


def _reflectances(
    given: Reflectances, chains: Sequence[_Chain], posts: Sequence[str]
) -> tuple[list[float] | None, dict[str, float]]:
    """Return one for each segment, or those by name; the name "" stands for all."""
    share = arguments.number(0, 1)
    if isinstance(given, Mapping):
        known = [*(name for name, _, _ in chains), *posts]
        for name in given:
            if name not in known:
                raise InputError(f"reflectances: no wall or post {name!r}; there are {', '.join(known[:20])}")
        return None, {str(name): share("reflectances", value) for name, value in given.items()}
    values = arguments.numbers_in("reflectances", given, "a number from 0 to 1, one for each segment, or some by name")
    if not values.ndim:
        return None, {"": share("reflectances", given)}
    count = sum(len(points) - 1 + closed for _, points, closed in chains)
    if values.shape != (count,):
        raise arguments.refusal("reflectances", f"one for each of {counted(count, 'segment')}", values)
    return [share("reflectances", value) for value in values.tolist()], {}


def _warn_of_centimetres(room: Room) -> None:
    ends = np.vstack((room.walls.reshape(-1, 2), room.posts[:, :2]))
    extent = float(np.ptp(ends, axis=0).max())
    if extent > _LARGE:
        unit, count = smaller_unit(extent, _USUAL)
        arguments.emit(f"walls: the room extends over {extent:g} m; if these are {unit}, divide them by {count}")
