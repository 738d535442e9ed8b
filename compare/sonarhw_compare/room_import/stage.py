"""Worlds of Stage: blocks and bitmaps of its models become a plan, and its robots become places.

Lengths are metres and angles degrees, by the definition of the format. As in Stage, the shape of a model is stretched
to its `size`, and the pose of a model is relative to the model that contains it.
"""

import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

import numpy as np
from sonarhw_sim.room.room import Place

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray
from sonarhw_compare.room_import.inputs import numbers_of, read_bytes, read_picture
from sonarhw_compare.room_import.plan import ForeignPlan, Span, WallChain
from sonarhw_compare.room_import.ros_map import plan_of_cells

_TOKEN = re.compile(r'#[^\n]*|"[^"\n]*"|[\[\]()]|[^\s\[\]()"#]+(?:\[\d+\])?')
_DEVICES = (
    *("ranger", "sensor", "laser", "sonar", "camera", "fiducial", "gripper", "blinkenlight", "blobfinder"),
    *("bumper", "speech", "light", "actuator", "window", "lightindicator"),
)
_MOST_DEPTH = 50
_MOST_FILES = 100

Value: TypeAlias = str | list[str]


@dataclass
class _Entity:
    """A model, with what its definition and its own text state."""

    kind: str
    values: dict[str, Value] = field(default_factory=dict)
    children: list["_Entity"] = field(default_factory=list)


@dataclass
class _World:
    """The definitions of a world, and what was read so far."""

    file: Path
    defined: dict[str, _Entity] = field(default_factory=dict)
    missing: list[str] = field(default_factory=list)
    files: int = 0
    plan: ForeignPlan = field(default_factory=ForeignPlan)
    left_out: Counter[str] = field(default_factory=Counter)


def read_stage(file: Path) -> ForeignPlan:
    """Return the plan of a world. Raises InputError."""
    world = _World(file)
    for entity in [*_parsed(world, file)]:
        _place(world, entity, np.eye(3), "", 0.0, 0)
    if world.missing:
        world.plan.notes.append(f"included files are missing: {', '.join(world.missing)}")
    if world.left_out:
        world.plan.notes.append(f"left out: {', '.join(f'{what} ({count})' for what, count in world.left_out.items())}")
    return world.plan


# The text: definitions, included files, and entities with properties in parentheses.


def _parsed(world: _World, file: Path) -> Iterator[_Entity]:
    """Yield the entities of a file and of the files that it includes."""
    world.files += 1
    if world.files > _MOST_FILES:
        raise InputError(f"{world.file}: includes more than {_MOST_FILES} files")
    text = read_bytes(file, "a world of Stage").decode("utf-8", "replace")
    tokens = [token for token in _TOKEN.findall(text) if not token.startswith("#")]
    tokens.reverse()
    while tokens:
        word = tokens.pop()
        if word == "include" and tokens:
            included = file.parent / tokens.pop().strip('"')
            if included.is_file():
                yield from _parsed(world, included)
            else:
                world.missing.append(included.name)
        elif word == "define" and len(tokens) > 2:
            name, base = tokens.pop(), tokens.pop()
            _expect(world, tokens, "(")
            world.defined[name] = _body(world, tokens, base, 0)
        elif tokens and tokens[-1] == "(":
            tokens.pop()
            yield _body(world, tokens, word, 0)
        else:
            _value(tokens)


def _body(world: _World, tokens: list[str], kind: str, depth: int) -> _Entity:
    """Return an entity from the text behind its opening parenthesis."""
    if depth > _MOST_DEPTH:
        raise InputError(f"{world.file}: models are nested more than {_MOST_DEPTH} deep")
    base = world.defined.get(kind)
    entity = _Entity(base.kind, dict(base.values), list(base.children)) if base else _Entity(kind)
    own_blocks = False
    while tokens:
        word = tokens.pop()
        if word == ")":
            return entity
        if tokens and tokens[-1] == "(":
            tokens.pop()
            child = _body(world, tokens, word, depth + 1)
            if word == "block" and not own_blocks:
                entity.children = [part for part in entity.children if part.kind != "block"]
                own_blocks = True
            entity.children.append(child)
        else:
            entity.values[word] = _value(tokens)
    raise InputError(f"{world.file}: the parenthesis of {kind[:40]!r} is not closed")


def _value(tokens: list[str]) -> Value:
    if not tokens or tokens[-1] in ("(", ")"):
        return ""
    word = tokens.pop()
    if word != "[":
        return word.strip('"')
    values = []
    while tokens and tokens[-1] not in ("]", "(", ")"):
        values.append(tokens.pop())
    if tokens and tokens[-1] == "]":
        tokens.pop()
    return values


def _expect(world: _World, tokens: list[str], token: str) -> None:
    if not tokens or tokens.pop() != token:
        raise InputError(f"{world.file}: expected {token!r} behind a definition")


def _numbers(world: _World, entity: _Entity, key: str, default: list[float]) -> list[float]:
    """Return the numbers of a property. Raises InputError."""
    value = entity.values.get(key)
    if value is None:
        return default
    words = [value] if isinstance(value, str) else value
    numbers = numbers_of(words)
    if not numbers:
        raise InputError(
            f"{world.file}: {key} of {entity.kind}: expected numbers up to 1e9, got {' '.join(words)[:60]!r}"
        )
    return numbers


def _text(entity: _Entity, key: str) -> str:
    value = entity.values.get(key, "")
    return value if isinstance(value, str) else " ".join(value)


# Models, in the coordinates of the world.


def _place(world: _World, entity: _Entity, parent: FloatArray, prefix: str, bottom: float, depth: int) -> None:
    """Add the surfaces of an entity and of those in it; `parent` is the pose that its own is relative to."""
    if entity.kind in (*_DEVICES, "block") or depth > _MOST_DEPTH:
        return
    name = " ".join(filter(None, (prefix, _text(entity, "name")))) or entity.kind
    x, y, up, turn = _pose(world, entity, "pose")
    pose = parent @ _matrix(x, y, turn)
    has_shape = "bitmap" in entity.values or any(child.kind == "block" for child in entity.children)
    if entity.kind == "position" or (entity.kind != "model" and not has_shape):
        if "pose" in entity.values:
            heading = math.atan2(pose[1, 0], pose[0, 0])
            world.plan.places.append(Place(name, (float(pose[0, 2]), float(pose[1, 2])), heading))
            unknown = "" if entity.kind == "position" else f" of the unknown type {entity.kind!r}"
            world.plan.notes.append(f"model {name!r}{unknown} is a place; its body is left out")
        return
    size = _numbers(world, entity, "size", [1.0, 1.0, 1.0])
    width, length, height = (*size, 1.0)[:3] if len(size) == 2 else (*size, 1.0, 1.0)[:3]
    if _is_transparent(world, entity):
        world.left_out["models without echoes"] += 1
    else:
        ox, oy, _, turned = _pose(world, entity, "origin")
        body = pose @ _matrix(ox, oy, turned)
        _add_shape(world, entity, body, (width, length), (bottom + up, bottom + up + height), name)
    for child in entity.children:
        _place(world, child, pose, name, bottom + up + height, depth + 1)


def _is_transparent(world: _World, entity: _Entity) -> bool:
    if "ranger_return" in entity.values:
        return _numbers(world, entity, "ranger_return", [0.0])[0] < 0
    return _text(entity, "laser_return") == "0"


def _pose(world: _World, entity: _Entity, key: str) -> tuple[float, float, float, float]:
    """Return x, y, z (m) and the turn (rad); older worlds state no z."""
    numbers = _numbers(world, entity, key, [0.0, 0.0, 0.0, 0.0])
    if len(numbers) not in (3, 4):
        raise InputError(f"{world.file}: {key} of {entity.kind}: expected [x y z heading], got {numbers}")
    x, y, *between, turn = numbers
    return x, y, between[0] if between else 0.0, math.radians(turn)


def _matrix(x: float, y: float, turn: float) -> FloatArray:
    cos, sin = math.cos(turn), math.sin(turn)
    return np.array([[cos, -sin, x], [sin, cos, y], [0.0, 0.0, 1.0]])


def _add_shape(
    world: _World, entity: _Entity, body: FloatArray, size: tuple[float, float], span: Span, name: str
) -> None:
    """Add a bitmap, the blocks, or without both a box."""
    half = np.array(size) / 2
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    if not (half > 0).all() or not span[0] < span[1]:
        world.left_out["models without an area"] += 1
        return
    if "bitmap" in entity.values:
        _add_bitmap(world, entity, body, size, span, name)
    elif blocks := [child for child in entity.children if child.kind == "block"]:
        _add_blocks(world, blocks, body, half, span, name)
    else:
        _add(world, corners, body, span, name, solid=True)
    if _text(entity, "boundary") in ("1", "true"):
        _add(world, corners, body, span, f"{name} boundary", solid=False)


def _add(world: _World, points: FloatArray, body: FloatArray, span: Span, name: str, solid: bool) -> None:
    placed = points @ body[:2, :2].T + body[:2, 2]
    world.plan.outlines.append(WallChain(name, placed, True, span, solid))


def _add_blocks(
    world: _World, blocks: list[_Entity], body: FloatArray, half: FloatArray, span: Span, name: str
) -> None:
    """Add the polygons of a model, stretched to its size."""
    polygons = [_polygon(world, block) for block in blocks]
    every = np.vstack(polygons)
    low, extent = every.min(axis=0), np.ptp(every, axis=0)
    levels = [_numbers(world, block, "z", [0.0, 1.0]) for block in blocks]
    top = max(max(level) for level in levels)
    if not (extent > 0).all() or top <= 0:
        world.left_out["models without an area"] += 1
        return
    for number, (polygon, level) in enumerate(zip(polygons, levels, strict=True)):
        bottom, height = (
            span[0] + min(level) / top * (span[1] - span[0]),
            span[0] + max(level) / top * (span[1] - span[0]),
        )
        part = name if len(polygons) == 1 else f"{name} block {number}"
        if bottom < height:
            _add(world, ((polygon - low) / extent * 2 - 1) * half, body, (bottom, height), part, solid=True)


def _polygon(world: _World, block: _Entity) -> FloatArray:
    keys = sorted((key for key in block.values if key.startswith("point[")), key=lambda key: int(key[6:-1]))
    points = [_numbers(world, block, key, []) for key in keys]
    if len(points) < 3 or any(len(point) != 2 for point in points):
        raise InputError(f"{world.file}: a block: expected three or more points [x y], got {len(points)}")
    return np.array(points)


def _add_bitmap(
    world: _World, entity: _Entity, body: FloatArray, size: tuple[float, float], span: Span, name: str
) -> None:
    """Add the outline of the dark pixels of a bitmap, stretched to the size of the model."""
    picture = world.file.parent / _text(entity, "bitmap")
    dark = read_picture(picture, f"the bitmap of model {name!r}") < 0.5
    rows, columns = np.flatnonzero(dark.any(axis=1)), np.flatnonzero(dark.any(axis=0))
    if not len(rows):
        raise InputError(f"{picture}: has no dark pixel; expected the walls of model {name!r}")
    dark = np.flipud(dark[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1])
    scale = np.array(size) / (dark.shape[1], dark.shape[0])
    cell = float(scale.max())
    origin = body[:2, :2] @ (-np.array(size) / 2) + body[:2, 2]
    traced = plan_of_cells(
        dark, cell, (float(origin[0]), float(origin[1])), np.diag(scale / cell) @ body[:2, :2].T, name
    )
    world.plan.outlines += [WallChain(one.name, one.points, one.closed, span) for one in traced.outlines]
    world.plan.rounds += traced.rounds
    world.plan.notes += traced.notes
