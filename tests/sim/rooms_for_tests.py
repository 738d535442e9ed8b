"""Rooms made in tests: from corners, and at random; with the answer known some other way."""

import math

import numpy as np
from numpy.typing import ArrayLike

from sim.room import Room, parse_room


def polygon_room(points: list[tuple[float, float]], *, closed: bool = True, extra: str = "") -> Room:
    """A room of one wall chain, reflectance 0.9, with `extra` TOML behind it."""
    corners = ", ".join(f"[{x!r}, {y!r}]" for x, y in points)
    return parse_room(
        f"""
        name = "test room"
        [materials.hard]
        reflectance = 0.9
        [[walls]]
        name = "w"
        points = [{corners}]
        closed = {str(closed).lower()}
        material = "hard"
        {extra}
        """,
        "test room",
    )


def star_room(seed: int, corners: int, *, convex: bool) -> Room:
    """A random closed room round the origin: corners on a circle (convex) or at random distances from it."""
    random = np.random.default_rng(seed)
    angles = np.sort(random.uniform(0, math.tau, corners))
    while np.max(np.diff(np.append(angles, angles[0] + math.tau))) > math.pi * 0.9:
        angles = np.sort(random.uniform(0, math.tau, corners))
    radii = np.full(corners, 2.0) if convex else random.uniform(1.0, 3.0, corners)
    return polygon_room([(float(r * np.cos(a)), float(r * np.sin(a))) for r, a in zip(radii, angles, strict=True)])


def room_of(walls: ArrayLike, posts: ArrayLike = (), reflectances: ArrayLike = ()) -> Room:
    """A room of single walls w0, w1, ... (n, 4) and posts p0, p1, ... (m, 3), m.

    `reflectances` are those of walls, then posts; all are 1 where none are given. Where there is no wall, one stands
    out of hearing.
    """
    lines = np.asarray(walls, dtype=np.float64).reshape(-1, 4)
    circles = np.asarray(posts, dtype=np.float64).reshape(-1, 3)
    shares = np.asarray(reflectances, dtype=np.float64) if np.size(reflectances) else np.ones(len(lines) + len(circles))
    parts = ['name = "test room"']
    parts += [f"[materials.m{k}]\nreflectance = {share!r}" for k, share in enumerate(shares.tolist())]
    parts += [
        f'[[walls]]\nname = "w{k}"\nedges = ["w{k}"]\npoints = [[{a!r}, {b!r}], [{c!r}, {d!r}]]\nmaterial = "m{k}"'
        for k, (a, b, c, d) in enumerate(lines.tolist())
    ] or ['[[walls]]\nname = "far"\npoints = [[9e4, 9e4], [9e4, 9.1e4]]\nmaterial = "m0"']
    parts += [
        f'[[posts]]\nname = "p{k}"\ncenter = [{x!r}, {y!r}]\nradius = {r!r}\nmaterial = "m{len(lines) + k}"'
        for k, (x, y, r) in enumerate(circles.tolist())
    ]
    return parse_room("\n".join(parts), "test room")
