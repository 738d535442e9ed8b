"""Rooms made in tests: from corners, and at random; with the answer known some other way."""

import math

import numpy as np

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
