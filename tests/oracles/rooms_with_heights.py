"""Rooms with floor, ceiling and low walls, and the images of a box room."""

from sonarhw_sim.room.room import Place, Room, parse_room

LEVELS = """
[floor]
height = 0.0
material = "lino"
[ceiling]
height = 2.4
material = "tiles"
"""


def room_of(walls: str, levels: str = LEVELS, places: str = "") -> Room:
    """Return a room with these walls and posts, floor and ceiling, in TOML."""
    return parse_room(
        f"""
        name = "room with heights"
        {levels}
        {walls}
        {places}
        [materials.lino]
        reflectance = 0.8
        [materials.tiles]
        reflectance = 0.7
        [materials.hard]
        reflectance = 0.9
        """,
        "room with heights",
    )


def wall(
    name: str, *points: tuple[float, float], height: tuple[float, float] | None = None, closed: bool = False
) -> str:
    """Return the TOML of a wall."""
    lines = [
        f'name = "{name}"',
        f"points = [{', '.join(f'[{x!r}, {y!r}]' for x, y in points)}]",
        f"closed = {str(closed).lower()}",
        'material = "hard"',
        f'edges = ["{name}"]' if len(points) == 2 else "",
        "" if height is None else f"height = {list(height)}",
    ]
    return "\n".join(["[[walls]]", *lines, ""])


def post(name: str, x: float, y: float, radius: float, height: tuple[float, float] | None = None) -> str:
    """Return the TOML of a post."""
    span = "" if height is None else f"height = [{height[0]}, {height[1]}]"
    return f'[[posts]]\nname = "{name}"\ncenter = [{x}, {y}]\nradius = {radius}\nmaterial = "hard"\n{span}\n'


BOX = wall("w", (0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 2.0), closed=True)
HERE = Place("here", (1.1, 0.7), height=0.9)


def image_gain(i: int, j: int, k: int) -> float:
    """Return the gain of the image of BOX with these numbers along x, y and z."""
    upward = (abs(k) + (1 if k > 0 else 0)) // 2
    return float(0.9 ** (abs(i) + abs(j)) * 0.7**upward * 0.8 ** (abs(k) - upward))


def image_at(n: int, at: float, width: float) -> float:
    """Return the coordinate (m) of image n of a point between two walls at 0 and `width`."""
    return n * width + at if n % 2 == 0 else (n + 1) * width - at
