"""Independent image sources: every sequence of walls is tried, without the product's geometry.

It uses complex numbers instead of vectors, and brute force instead of rays. Both share only the law of reflection.
"""

import itertools

from sonarhw_sim.room.room import Room


def specular_lengths(room: Room, position: tuple[float, float], order: int) -> list[float]:
    """Return the lengths (m) of all specular paths of one to `order` reflections from `position` back to it, sorted."""
    walls = [(complex(x0, y0), complex(x1, y1)) for x0, y0, x1, y1 in room.walls.tolist()]
    home = complex(*position)
    found = []
    for count in range(1, order + 1):
        for sequence in itertools.product(range(len(walls)), repeat=count):
            if all(a != b for a, b in itertools.pairwise(sequence)):
                length = _length(walls, home, sequence)
                if length is not None:
                    found.append(length)
    return sorted(found)


def _length(walls: list[tuple[complex, complex]], home: complex, sequence: tuple[int, ...]) -> float | None:
    images = [home]
    for k in reversed(sequence):
        a, b = walls[k]
        turn = (b - a) / abs(b - a)
        images.append(a + turn * ((images[-1] - a) / turn).conjugate())
    corners, here = [home], home
    for k, image in zip(sequence, reversed(images), strict=False):
        touch = _crossing(here, image, *walls[k])
        if touch is None:
            return None
        here = touch
        corners.append(touch)
    corners.append(home)
    for k, (a, b) in enumerate(itertools.pairwise(corners)):
        for w, wall in enumerate(walls):
            own = sequence[max(k - 1, 0) : k + 1]
            if w not in own and _crossing(a, b, *wall) is not None:
                return None
    return abs(images[-1] - home)


def _crossing(a: complex, b: complex, c: complex, d: complex) -> complex | None:
    """Where the segments a–b and c–d cross, both within their ends."""
    r, s = b - a, d - c
    cross = (r.conjugate() * s).imag
    if cross == 0:
        return None
    t = ((c - a).conjugate() * s).imag / cross
    u = ((c - a).conjugate() * r).imag / cross
    return a + t * r if 0 <= t <= 1 and 0 <= u <= 1 else None
