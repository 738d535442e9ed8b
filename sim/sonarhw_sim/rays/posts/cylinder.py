"""How strongly a thin post reflects: the exact series of a cylinder, where ray optics is wrong."""

import math
from dataclasses import replace

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.board.transducer import ComplexArray
from sonarhw_sim.rays.partial_paths import PartialPaths
from sonarhw_sim.room.model import Room

THIN = 0.005  # m: ray optics is good enough for posts from this radius on
_TERMS = 24  # more than enough for ka up to 8, or 86 kHz


def cylinder_factor(ka: FloatArray, incidence: FloatArray, reflectances: FloatArray) -> ComplexArray:
    """Return the amplitude of an echo from a cylinder relative to ray optics, (n,) complex.

    `ka` (n,) is the wave number times the radius, `incidence` (n,) rad that of the ray, `reflectances` (n,), over 0,
    those of the surface. Far from the cylinder, the scattered wave is -√(2 / (π k r)) exp(jπ/4) f with
    f = Σ εₙ Jₙ*(ka) / Hₙ*(ka) cos n(π − 2i), where Z* = Z′ − j β Z and β = (1 − ρ)/(1 + ρ) is the admittance relative
    to that of air (Morse and Ingard, Theoretical Acoustics, ch. 8). Its phase is that of a wave by way of the centre.
    Ray optics gives ρ √(a cos i / (2 r)), by way of the side, which is shorter by 2 a cos i.
    """
    from scipy.special import h2vp, hankel2, jv, jvp  # slow to import, and most rooms have no thin posts

    order = np.arange(_TERMS)[:, None]
    weight = np.where(order == 0, 1.0, 2.0)
    admittance = 1j * (1.0 - reflectances) / (1.0 + reflectances)
    returned = (jvp(order, ka) - admittance * jv(order, ka)) / (h2vp(order, ka) - admittance * hankel2(order, ka))
    total = (weight * returned * np.cos(order * (math.pi - 2 * incidence))).sum(axis=0)
    cosine = np.cos(incidence)
    by_rays = np.sqrt(math.pi * ka * cosine) * reflectances * np.exp(2j * ka * cosine - 0.25j * math.pi)
    return np.asarray(-2 * total / by_rays)


def with_thin_posts(room: Room, paths: PartialPaths, wavelength: float) -> PartialPaths:
    """Return paths by rays with the gain and phase that thin posts give them."""
    if not (room.posts[:, 2] < THIN).any():
        return paths
    factors = np.ones(len(paths), np.complex128)
    # surface -1, "none", selects the last
    radii = np.concatenate((np.full(len(room.walls), np.inf), room.posts[:, 2], [np.inf]))[paths.surfaces]
    row, touch = np.nonzero(radii < THIN)
    if len(row):
        # the edge of a diffracted path is a point between two reflections
        point = touch + 1 + ((paths.edges[row] >= 0) & (touch >= paths.bends[row]))
        before, at, after = (paths.points[row, point + step] for step in (-1, 0, 1))
        back, on = _unit(before - at), _unit(after - at)
        incidence = np.arccos(np.clip((back * on).sum(axis=1), -1.0, 1.0)) / 2
        ka = math.tau / wavelength * radii[row, touch]
        np.multiply.at(factors, row, cylinder_factor(ka, incidence, room.reflectances[paths.surfaces[row, touch]]))
    return replace(paths, gains=paths.gains * np.abs(factors), phases=paths.phases + np.angle(factors))


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.hypot(vectors[:, 0], vectors[:, 1])[:, None])
