"""Worlds and models of Gazebo in SDF: boxes, cylinders, spheres and polylines of the collisions become a plan.

Lengths are metres and angles radians, by the definition of SDF. A model with a distance sensor is a robot: it becomes
a place, not a surface.
"""

import math
import os
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from sonarhw_sim.room.room import Place

from sonarhw.errors import InputError, counted
from sonarhw.readings import FloatArray
from sonarhw_compare.room_import.inputs import numbers_of, read_bytes
from sonarhw_compare.room_import.plan import ForeignPlan, RoundObject, Span, WallChain

_SENSORS = ("ray", "gpu_ray", "lidar", "gpu_lidar", "sonar")
_UPRIGHT = math.cos(math.radians(1.0))
_MOST_DEPTH = 50  # of nested models
_MOST_INCLUDED = 1000  # models
_PATHS = ("GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "GAZEBO_MODEL_PATH", "SDF_PATH")
_MODEL_FILES = ("model.sdf", "model-1_4.sdf")

Pose = FloatArray  # (4, 4), from the coordinates of an element to those of the world


@dataclass
class _World:
    """What was read so far."""

    file: Path
    plan: ForeignPlan = field(default_factory=ForeignPlan)
    left_out: Counter[str] = field(default_factory=Counter)
    included: int = 0


def read_sdf(file: Path) -> ForeignPlan:
    """Return the plan of a world or a model. Raises InputError."""
    root = _root(file)
    world = _World(file)
    for scope in root.findall("world") or [root]:
        _read_scope(world, scope, np.eye(4), "", 0, file)
    if world.left_out:
        listed = ", ".join(f"{what} ({count})" for what, count in world.left_out.items())
        world.plan.notes.append(f"left out: {listed}")
    return world.plan


def _root(file: Path) -> ElementTree.Element:
    try:
        root = ElementTree.fromstring(read_bytes(file, "a Gazebo world"))
    except (ElementTree.ParseError, ValueError, LookupError) as error:  # LookupError: an unknown encoding
        raise InputError(f"{file}: is not a Gazebo world: {error}") from error
    if root.tag not in ("sdf", "gazebo"):
        raise InputError(f"{file}: expected the element <sdf>, got <{root.tag[:40]}>")
    return root


def _read_scope(world: _World, scope: ElementTree.Element, pose: Pose, prefix: str, depth: int, file: Path) -> None:
    """Read the models and included models of a world or a model, whose pose is given."""
    if depth > _MOST_DEPTH:
        raise InputError(f"{world.file}: models are nested more than {_MOST_DEPTH} deep")
    frames = _frames(world, scope, pose)
    saved = _saved_poses(scope)
    for model in scope.findall("model"):
        name = _named(model, prefix)
        own = saved.get(model.get("name", ""), model.find("pose"))
        _read_model(world, model, _placed(world, own, frames, pose), name, depth, file)
    for include in scope.findall("include"):
        _read_include(world, include, frames, pose, prefix, depth, file)


def _saved_poses(scope: ElementTree.Element) -> dict[str, ElementTree.Element]:
    """Return the poses that the models of a world had when it was saved."""
    models = ((model.get("name", ""), model.find("pose")) for model in scope.findall("state/model"))
    return {name: pose for name, pose in models if pose is not None}


def _read_model(world: _World, model: ElementTree.Element, pose: Pose, name: str, depth: int, file: Path) -> None:
    frames = _frames(world, model, pose)
    sensors = [
        (link, sensor)
        for link in model.findall("link")
        for sensor in link.findall("sensor")
        if sensor.get("type") in _SENSORS
    ]
    if sensors:
        link, sensor = sensors[0]
        of_link = _placed(world, link.find("pose"), frames, pose)
        frame = _placed(world, sensor.find("pose"), frames, of_link)
        place = Place(
            name, (float(frame[0, 3]), float(frame[1, 3])), math.atan2(frame[1, 0], frame[0, 0]), float(frame[2, 3])
        )
        world.plan.places.append(place)
        world.plan.notes.append(f"model {name!r} has a distance sensor: it is a place, its body is left out")
        return
    for link in model.findall("link"):
        of_link = _placed(world, link.find("pose"), frames, pose)
        links = len(model.findall("link"))
        _read_link(world, link, of_link, name if links == 1 else _named(link, name), frames)
    _read_scope(world, model, pose, name, depth + 1, file)


def _read_link(world: _World, link: ElementTree.Element, pose: Pose, name: str, frames: dict[str, Pose]) -> None:
    bodies = link.findall("collision") or link.findall("visual")
    for body in bodies:
        geometry = body.find("geometry")
        if geometry is None or not len(geometry):
            world.left_out["bodies without geometry"] += 1
            continue
        own = name if len(bodies) == 1 else _named(body, name)
        _read_geometry(world, geometry[0], _placed(world, body.find("pose"), frames, pose), own)


def _read_geometry(world: _World, shape: ElementTree.Element, pose: Pose, name: str) -> None:
    match shape.tag:
        case "box":
            _read_box(world, _numbers(world, shape.find("size"), 3), pose, name)
        case "cylinder" | "capsule":
            (radius,), (length,) = (_numbers(world, shape.find(key), 1) for key in ("radius", "length"))
            _read_cylinder(world, radius, length, pose, name)
        case "sphere":
            (radius,) = _numbers(world, shape.find("radius"), 1)
            low, high = pose[2, 3] - radius, pose[2, 3] + radius
            _add_round(world, RoundObject(name, (pose[0, 3], pose[1, 3]), radius, (low, high)))
        case "polyline":
            (height,) = _numbers(world, shape.find("height"), 1)
            points = [_numbers(world, point, 2) for point in shape.findall("point")]
            _add_solid(world, np.array(points).reshape(-1, 2), (0.0, height), pose, name)
        case "plane":
            if pose[2, 2] > _UPRIGHT:
                world.plan.floor = float(pose[2, 3])
            else:
                world.left_out["tilted planes"] += 1
        case "mesh":
            world.left_out[f"mesh of {name!r}"] += 1
        case tag:
            world.left_out[f"{tag} of {name!r}"] += 1


def _read_box(world: _World, size: list[float], pose: Pose, name: str) -> None:
    """Add a box if one of its axes is upright."""
    upright = int(np.abs(pose[2, :3]).argmax())
    axes = [axis for axis in range(3) if axis != upright]
    if abs(pose[2, upright]) < _UPRIGHT:
        world.left_out["tilted boxes"] += 1
        return
    corners = np.zeros((4, 3))
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    corners[:, axes] = signs * np.array(size)[axes] / 2
    points = (corners @ pose[:3, :3].T + pose[:3, 3])[:, :2]
    low, high = pose[2, 3] - size[upright] / 2, pose[2, 3] + size[upright] / 2
    _add_outline(world, points, (low, high), name)


def _read_cylinder(world: _World, radius: float, length: float, pose: Pose, name: str) -> None:
    if abs(pose[2, 2]) < _UPRIGHT:
        world.left_out["tilted cylinders"] += 1
        return
    span = pose[2, 3] - length / 2, pose[2, 3] + length / 2
    _add_round(world, RoundObject(name, (pose[0, 3], pose[1, 3]), radius, span))


def _add_solid(world: _World, points: FloatArray, span: Span, pose: Pose, name: str) -> None:
    """Add a prism over points of the plan of an element."""
    if pose[2, 2] < _UPRIGHT:
        world.left_out["tilted polylines"] += 1
        return
    placed = points @ pose[:2, :2].T + pose[:2, 3]
    _add_outline(world, placed, (span[0] + pose[2, 3], span[1] + pose[2, 3]), name)


def _add_outline(world: _World, points: FloatArray, span: Span, name: str) -> None:
    if len(points) > 1 and (points[0] == points[-1]).all():
        points = points[:-1]
    area = abs(float(np.sum(points[:, 0] * np.roll(points[:, 1], -1) - points[:, 1] * np.roll(points[:, 0], -1)))) / 2
    if len(points) < 3 or not area or not span[0] < span[1]:
        world.left_out["bodies without an area"] += 1
        return
    world.plan.outlines.append(WallChain(name, points, True, (float(span[0]), float(span[1])), True))


def _add_round(world: _World, post: RoundObject) -> None:
    if post.radius <= 0 or post.span is None or not post.span[0] < post.span[1]:
        world.left_out["bodies without an area"] += 1
        return
    center = float(post.center[0]), float(post.center[1])
    world.plan.rounds.append(replace(post, center=center, span=(float(post.span[0]), float(post.span[1]))))


def _named(element: ElementTree.Element, prefix: str) -> str:
    """Return a name within a model, without the name of the model if it begins with it."""
    outer, _, last = prefix.rpartition(" ")
    name = element.get("name", "")
    return " ".join(filter(None, (outer if last and name.startswith(last) else prefix, name)))


# Poses, and the frames that they are relative to.


def _frames(world: _World, scope: ElementTree.Element, pose: Pose) -> dict[str, Pose]:
    """Return the poses of the named frames, links and models of a scope."""
    elements = {
        element.get("name", ""): element for tag in ("frame", "link", "model") for element in scope.findall(tag)
    }
    frames: dict[str, Pose] = {"": pose, "__model__": pose, "world": pose}

    def resolve(name: str, depth: int) -> Pose:
        if name in frames:
            return frames[name]
        if name not in elements or depth > _MOST_DEPTH:
            raise InputError(f"{world.file}: unknown frame {name[:60]!r} in relative_to")
        element = elements[name]
        own = element.find("pose")
        base = _base(own) or element.get("attached_to", "")
        frames[name] = resolve(base, depth + 1) @ _matrix(world, own)
        return frames[name]

    for name in elements:
        resolve(name, 0)
    return frames


def _base(pose: ElementTree.Element | None) -> str:
    return "" if pose is None else pose.get("relative_to", "")


def _placed(world: _World, own: ElementTree.Element | None, frames: dict[str, Pose], parent: Pose) -> Pose:
    """Return the pose of an element with this <pose> in the world."""
    base = _base(own)
    if base and base not in frames:
        raise InputError(f"{world.file}: unknown frame {base[:60]!r} in relative_to")
    return np.asarray((frames[base] if base else parent) @ _matrix(world, own))


def _matrix(world: _World, pose: ElementTree.Element | None) -> Pose:
    """Return the transform of x y z roll pitch yaw, or of x y z and a quaternion."""
    matrix = np.eye(4)
    if pose is None or not (pose.text or "").split():
        return matrix
    quaternion = pose.get("rotation_format") == "quat_xyzw"
    numbers = _numbers(world, pose, 7 if quaternion else 6)
    matrix[:3, 3] = numbers[:3]
    angles = np.radians(numbers[3:]) if pose.get("degrees", "").lower() in ("true", "1") else np.array(numbers[3:])
    matrix[:3, :3] = _of_quaternion(np.array(numbers[3:])) if quaternion else _of_angles(angles)
    return matrix


def _of_angles(angles: FloatArray) -> FloatArray:
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles), np.cos(angles)
    roll = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    pitch = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    yaw = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return np.asarray(yaw @ pitch @ roll)


def _of_quaternion(parts: FloatArray) -> FloatArray:
    x, y, z, w = parts / (np.linalg.norm(parts) or 1.0)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _numbers(world: _World, element: ElementTree.Element | None, count: int) -> list[float]:
    if element is None:
        raise InputError(f"{world.file}: the size of a shape is missing")
    words = (element.text or "").split()
    numbers = numbers_of(words, count)
    if numbers is None:
        shown = " ".join(words)[:60]
        raise InputError(f"{world.file}: <{element.tag}>: expected {counted(count, 'number')} up to 1e9, got {shown!r}")
    return numbers


# Included models: files in folders beside the world, or in those that Gazebo looks in.


def _read_include(
    world: _World,
    include: ElementTree.Element,
    frames: dict[str, Pose],
    pose: Pose,
    prefix: str,
    depth: int,
    file: Path,
) -> None:
    uri = (include.findtext("uri") or "").strip()
    world.included += 1
    if world.included > _MOST_INCLUDED:
        raise InputError(f"{world.file}: includes more than {_MOST_INCLUDED} models")
    short = uri.rpartition("://")[2].strip("/")
    plain = short.rpartition("/")[2].lower().replace(" ", "_")
    if plain == "sun":
        return
    model_file = _model_file(short, file)
    if model_file is None:
        if plain == "ground_plane":
            world.plan.floor = 0.0
        else:
            world.left_out[f"model {uri[-60:]!r}, which is neither beside the file nor in {_PATHS[-2]}"] += 1
        return
    for model in _root(model_file).findall("model"):
        name = include.findtext("name") or model.get("name", "")
        name = " ".join(filter(None, (prefix, name)))
        own = include.find("pose") if include.find("pose") is not None else model.find("pose")
        _read_model(world, model, _placed(world, own, frames, pose), name.strip(), depth + 1, model_file)


def _model_file(short: str, file: Path) -> Path | None:
    """Return the file of an included model; None if it is not found."""
    beside = [folder for base in file.absolute().parents for folder in (base, base / "models")][:12]
    named = [Path(part) for name in _PATHS for part in os.environ.get(name, "").split(os.pathsep) if part]
    folders = [folder / short for folder in (*named, *beside)]
    candidates = [path for folder in folders for path in (folder, *(folder / name for name in _MODEL_FILES))]
    return next((path for path in candidates if path.is_file()), None)
