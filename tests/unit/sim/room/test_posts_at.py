"""Posts at a point, in rooms with several walls and posts."""

import pytest

from tests.fixtures.rooms_for_tests import room_of

WALLS = [[-5.0, -5.0, 5.0, -5.0], [-5.0, 5.0, 5.0, 5.0]]
POSTS = [(0.0, 0.0, 1.0), (0.5, 0.0, 1.0), (3.0, 3.0, 0.5)]


@pytest.mark.parametrize(
    ("point", "names"),
    [
        ((0.2, 0.1), ("p0", "p1")),
        ((-0.7, 0.0), ("p0",)),
        ((3.2, 3.1), ("p2",)),
        ((0.0, -1.0), ("p0",)),  # on the circle
        ((0.0, -1.001), ()),
        ((2.0, 2.0), ()),
    ],
)
def test_posts_at_a_point_are_those_that_contain_it(point: tuple[float, float], names: tuple[str, ...]) -> None:
    room = room_of(WALLS, POSTS)
    assert tuple(room.names[surface] for surface in room.posts_at(point)) == names
