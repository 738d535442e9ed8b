"""Vertical sections: paths by way of floor and ceiling, and over the tops of walls.

Each section is a vertical plane through the transducer (`vertical.vertical_section`), where the two-dimensional core
follows sound as in the plan. Sound stays in such a plane only if it meets surfaces perpendicularly. A plane
therefore contains the foot of the perpendicular on a wall, the axis of a post, or a vertical edge or inner corner that
returns sound straight back in the plan.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from sonarhw_sim.rays.paths import Paths, PathSearch, find_paths
from sonarhw_sim.room.model import Place, Room
from sonarhw_sim.room.room_file import MEETING
from sonarhw_sim.vertical.lifting import lifted
from sonarhw_sim.vertical.vertical_section import (
    LEVEL,
    PARALLEL,
    Mirror,
    Plane,
    SectionQuery,
    chord,
    draw_section,
    span_of,
)


def rim_paths(room: Room, place: Place, height: float, search: PathSearch, flat: Paths) -> list[Paths]:
    """Return the paths that rims bend, one table for each plane; `flat` are those of the plan."""
    if not np.isfinite(room.heights[: room.levels.start]).any() or not search.diffraction:
        return []
    view = SectionQuery(room, place.position, height, search)
    planes = [Plane(0.0, ()), *_wall_planes(view), *_post_planes(view), *_edge_and_corner_planes(view, flat)]
    tables = [_follow(view, plane) for plane in planes]
    return [paths.select(np.flatnonzero(paths.edges >= len(room.edges))) for paths in tables]


def _wall_planes(view: SectionQuery) -> Iterator[Plane]:
    """Yield the planes perpendicular to walls that contain the foot of the perpendicular; parallel walls share one."""
    room = view.room
    starts, along = room.walls[:, :2] - view.position, room.walls[:, 2:] - room.walls[:, :2]
    lengths = np.hypot(*along.T)
    foot = -(starts * along).sum(axis=1) / lengths
    # normals within 0..π, because a plane extends in both directions
    turned = np.arctan2(along[:, 0], -along[:, 1])
    directions = np.mod(turned, math.pi)
    directions[directions > math.pi - PARALLEL] -= math.pi
    at = starts[:, 0] * np.cos(directions) + starts[:, 1] * np.sin(directions)
    met = (foot >= -LEVEL) & (foot <= lengths + LEVEL) & (np.abs(at) <= view.reach / 2)
    walls = np.flatnonzero(met)[np.argsort(directions[met], kind="stable")]
    breaks = np.flatnonzero(np.diff(directions[walls]) > PARALLEL) + 1
    for group in np.split(walls, breaks) if len(walls) else []:
        mirrors = [Mirror(float(at[k]), span_of(room, k), float(room.reflectances[k]), (int(k),)) for k in group]
        yield Plane(float(directions[group[0]]), tuple(mirrors), once=False)


def _post_planes(view: SectionQuery) -> Iterator[Plane]:
    room = view.room
    for post, (x, y, radius) in enumerate(room.posts.tolist()):
        direction = math.atan2(y - view.position[1], x - view.position[0])
        within = chord(view, direction, post)
        surface = len(room.walls) + post
        if within is None or not 0.0 < within[0] <= view.reach / 2:
            continue
        curvature = math.sqrt(radius / (radius + within[0]))
        reflectance = float(room.reflectances[surface]) * curvature
        mirror = Mirror(within[0], span_of(room, surface), reflectance, (surface,), curvature=curvature)
        yield Plane(direction, (mirror,))


def _edge_and_corner_planes(view: SectionQuery, flat: Paths) -> Iterator[Plane]:
    """Yield the planes to edges and inner corners that return sound straight back in the plan."""
    back = np.hypot(*(flat.leaving - flat.arriving).T) <= LEVEL
    for k in np.flatnonzero(back).tolist():
        inner = flat.outline(k)[1:-1]
        straight = np.abs(inner - inner[:1]).max(initial=0.0) <= MEETING
        touched = tuple(int(surface) for surface in flat.surfaces[k] if surface >= 0)
        edge = int(flat.edges[k])
        if not straight or (len(touched) < 2 if edge < 0 else len(touched) > 0):
            continue
        surfaces = touched if edge < 0 else view.room.surfaces_at_edge(edge)
        spans = view.room.heights[list(surfaces)]
        span = float(spans[:, 0].max()), float(spans[:, 1].min())
        at, gain, phase = float(flat.lengths[k]) / 2, float(flat.gains[k]), float(flat.phases[k])
        mirror = Mirror(at, span, gain, touched, edge, phase=phase)
        yield Plane(float(flat.departures[k]), (mirror,))


def _follow(view: SectionQuery, plane: Plane) -> Paths:
    """Return the paths of one plane that belong to no other plane."""
    section = draw_section(view, plane)
    # one more, because a vertical edge is a reflecting wall in the section, but does not count as a reflection
    search = replace(view.search, max_bounces=view.search.max_bounces + 1, axes=None)
    found = find_paths(section.room, (0.0, view.height), search)
    return lifted(view, plane, section, found)
