"""Lifting: converts the paths of a vertical section to paths of the room, with directions in the plan and elevations.

Paths that the plan or another plane contains are omitted.
"""

import math
from dataclasses import dataclass

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.model import Room
from sonarhw_sim.vertical.vertical_section import LEVEL, Mirror, Owner, Plane, Section, SectionQuery, walls_at_edge


@dataclass(frozen=True)
class _Event:
    """A reflection or diffraction of a path of a section, with the room's numbers."""

    surfaces: tuple[int, ...]  # reflecting surfaces
    edge: int = -1  # diffracting edge
    gain: float = 1.0  # in addition to the gain in the section
    phase: float = 0.0  # rad, in addition to the phase in the section
    at_mirror: bool = True  # whether it is at one of the plane's mirrors, not at floor or ceiling


@dataclass(frozen=True)
class _Lifted:
    """One path of a section as a path of the room."""

    row: int  # in the section's paths
    events: tuple[_Event, ...]
    points: FloatArray  # (k, 2), in the plane

    @property
    def surfaces(self) -> tuple[int, ...]:
        return tuple(surface for event in self.events for surface in event.surfaces)

    @property
    def edge(self) -> int:
        return next((event.edge for event in self.events if event.edge >= 0), -1)

    @property
    def bend(self) -> int:
        """Number of reflections before the edge; without an edge, of all."""
        at = next((k for k, event in enumerate(self.events) if event.edge >= 0), len(self.events))
        return sum(len(event.surfaces) for event in self.events[:at])


def lifted(view: SectionQuery, plane: Plane, section: Section, found: Paths) -> Paths:
    """Return the paths `found` in the section of a plane as paths of the room, if no other plane contains them."""
    paths = [_lift(view, section, found, row) for row in range(len(found))]
    paths = [path for path in paths if _belongs(view, plane, path)]
    rows = np.array([path.row for path in paths], dtype=np.intp)
    bounces = max((len(path.surfaces) for path in paths), default=0)
    surfaces = np.full((len(paths), bounces), -1, dtype=np.int32)
    points = np.full((len(paths), bounces + 3, 2), np.nan)
    along = np.array([math.cos(plane.direction), math.sin(plane.direction)])
    for k, path in enumerate(paths):
        surfaces[k, : len(path.surfaces)] = path.surfaces
        points[k, : len(path.points)] = view.position + path.points[:, :1] * along
    departures, rising = _out_of_plane(plane, found.departures[rows])
    arrivals, sinking = _out_of_plane(plane, found.arrivals[rows])
    return Paths(
        lengths=found.lengths[rows],
        departures=departures,
        arrivals=arrivals,
        gains=found.gains[rows] * [math.prod(event.gain for event in path.events) for path in paths],
        phases=found.phases[rows] + np.array([sum(event.phase for event in path.events) for path in paths]),
        spreads=np.zeros(len(rows)),
        surfaces=surfaces,
        edges=np.array([path.edge for path in paths], dtype=np.int32),
        bends=np.array([path.bend for path in paths], dtype=np.int32),
        elevations=np.column_stack((rising, sinking)),
        points=points,
    )


def _lift(view: SectionQuery, section: Section, found: Paths, row: int) -> _Lifted:
    owners = [section.owners[wall] for wall in found.surfaces[row] if wall >= 0]
    events = [_touched(owner, float(found.lengths[row])) for owner in owners]
    if found.edges[row] >= 0:
        events.insert(int(found.bends[row]), _rim(view.room, section, int(found.edges[row])))
    corners = found.outline(row)
    # in a corner, sound meets both walls at one point
    times = [1, *(max(1, len(event.surfaces)) for event in events), 1]
    return _Lifted(row, tuple(events), np.repeat(corners, times, axis=0))


def _touched(owner: Owner, length: float) -> _Event:
    if isinstance(owner, Mirror):
        return (
            _Event(owner.surfaces)
            if owner.edge < 0
            else _Event((), owner.edge, _oblique_gain(owner, length), owner.phase)
        )
    return _Event(() if owner is None else (owner,), at_mirror=False)


def _oblique_gain(edge: Mirror, length: float) -> float:
    """Return the gain of an edge met obliquely by a path of this length (m), relative to perpendicular incidence.

    Keller's cone: the coefficient is proportional to 1/sin β for the angle β to the edge. It is divided by the root
    of the legs, which are proportional to 1/sin β too, so the gain is proportional to 1/√(sin β) (Kouyoumjian and
    Pathak 1974). The result is limited to the strength of a wall.
    """
    return min(math.sqrt(length / (2 * edge.at)), 1 / edge.reflectance)


def _rim(room: Room, section: Section, edge: int) -> _Event:
    mirror = next(
        owner
        for wall in walls_at_edge(section.room.edges.names[edge])
        if isinstance(owner := section.owners[wall], Mirror) and owner.has_rims
    )
    surface = mirror.surfaces[0]
    return _Event((), room.edge_between(surface, surface), mirror.curvature)


def _belongs(view: SectionQuery, plane: Plane, path: _Lifted) -> bool:
    """Return whether a path leaves the horizontal, belongs to this plane only, and has few enough reflections."""
    rises = np.abs(path.points[:, 1] - view.height).max() > LEVEL
    at_mirrors = sum(event.at_mirror for event in path.events)
    own = at_mirrors == bool(plane.mirrors) if plane.once else at_mirrors > 0
    return bool(rises) and own and len(path.surfaces) <= view.search.max_bounces


def _out_of_plane(plane: Plane, angles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return directions in the plan and elevations, (n,) rad each, of angles (n,) in a plane."""
    forward = np.cos(angles)
    directions = plane.direction + np.where(forward < 0, math.pi, 0.0)
    return np.arctan2(np.sin(directions), np.cos(directions)), np.arctan2(np.sin(angles), np.abs(forward))
