"""The picture of a room with readings: everything is inside it."""

import numpy as np
import pytest
from sonarhw_compare.pictures.overlay_picture import draw_plan
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.model import load_room


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
