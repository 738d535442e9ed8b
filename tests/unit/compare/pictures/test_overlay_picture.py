"""The picture of a room with readings: everything is inside it; other lines are what was found, and low walls."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from sonarhw_compare.drawings import draw_plan, draw_room
from sonarhw_compare.edits import add_post, add_wall, move_wall
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import load_room, parse_room


# plans of nearly equal width and height, whose labels and legends were cut off; a wide one; and a tall one
@pytest.mark.parametrize(
    ("room_name", "place", "board"),
    [
        ("right_corner", "figure12", "polaroid-6500"),
        ("right_corner", "figure13", "lego-nxt"),
        ("simple", "figure7", "lego-nxt"),
        ("arena", "p1", "paper"),
        ("arena", "p4", "lego-nxt"),
        ("corridor", "end", "polaroid-6500"),
        ("laboratory", "bench", "polaroid-6500"),
    ],
)
def test_labels_and_legend_are_inside_the_picture(room_name: str, place: str, board: str) -> None:
    room = load_room(f"rooms/{room_name}.toml")
    scan = predict_scan(room, room.places[place], load_board(board), np.radians(np.arange(0.0, 360.0, 3.0)))
    figure = draw_plan(scan, [(0.0, 1.0)])
    figure.canvas.draw()
    picture = np.asarray(figure.canvas.buffer_rgba())[:, :, :3]  # type: ignore[attr-defined]
    for name, edge in {
        "left": picture[:, 0],
        "right": picture[:, -1],
        "top": picture[0],
        "bottom": picture[-1],
    }.items():
        assert (edge == 255).all(), name


def test_only_what_was_found_is_dashed() -> None:
    room = load_room("simple")
    changed = move_wall(add_wall(room, (0.2, 0.2), (0.4, 0.2), "shelving"), room.names.index("right"), (0.02, 0.0))
    changed = add_post(changed, (0.3, 0.5), 0.01, "shelving")
    scan = predict_scan(room, room.places["figure9"], load_board("paper"), np.array([0.0]))
    figure = draw_plan(scan, changed=changed)
    (axes,) = figure.axes
    dashed = [line for line in axes.lines if line.get_linestyle() == "--"]
    walls = [np.asarray(line.get_xydata()).ravel().tolist() for line in dashed if len(np.asarray(line.get_xdata()))]
    # the neighbours of the moved wall have only become longer
    np.testing.assert_allclose(walls, [[0.948, 0.0, 0.948, 0.742], [0.2, 0.2, 0.4, 0.2]])
    (post,) = (patch for patch in axes.patches if isinstance(patch, Circle))
    assert (post.center, post.radius, post.get_linestyle()) == ((0.3, 0.5), 0.01, "--")
    assert "found wall or post" in [text.get_text() for text in figure.legends[0].get_texts()]
    plain = draw_plan(scan, changed=room)
    assert "found wall or post" not in [text.get_text() for text in plain.legends[0].get_texts()]


@pytest.mark.parametrize(
    ("place", "lines"),
    [
        (None, {"limited height": ":"}),
        ("plan", {}),  # where heights have no effect
        ("robot", {"lower than the transducer": ":"}),  # at 0.25 m: the step is below, bin and rug are not
        ("high", {"higher than the transducer": "-."}),  # below the rug
    ],
)
def test_walls_of_limited_height_have_another_line(place: str | None, lines: dict[str, str]) -> None:
    more = "\n[places.high]\nposition = [1.3, 0.9]\nheight = 0.05\n"
    room = parse_room(load_room("doorstep").text + more, "doorstep")
    axes = Figure().add_subplot()
    draw_room(axes, room, None if place is None else room.places[place])
    drawn = {line.get_label(): line.get_linestyle() for line in axes.lines}
    assert {label: line for label, line in drawn.items() if not str(label).startswith("_")} == lines
    styles = dict(zip(room.names, [line.get_linestyle() for line in axes.lines], strict=False))
    limited = {None: ["step", "rug"], "plan": [], "robot": ["step"], "high": ["rug"]}[place]
    assert [name for name in room.names[: len(room.walls)] if styles[name] != "-"] == limited
    (post,) = (patch for patch in axes.patches if isinstance(patch, Circle))
    assert post.get_fill() == (place is not None)  # 0.4 m high
