"""Parts of the plan that can be dragged, and the resulting scene, without a window."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sonarhw_compare.edits import add_post
from sonarhw_gui.model.edits import (
    Grip,
    GripPart,
    dragged,
    room_grip,
    sensor_at,
    sensor_grip,
    sensor_turned,
    surface_at,
    with_material_values,
)
from sonarhw_gui.model.look import LengthUnit
from sonarhw_gui.model.scene import Scene, bounce_losses, scene_of_log
from sonarhw_gui.session.scanner import start_recording
from sonarhw_gui.views.plan_tools import pose_text, surface_text
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.profile import load_board, parse_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, Room, load_room, parse_room

from sonarhw.errors import InputError
from sonarhw.log import read_log
from tests.fixtures.window_scene import ROOM

PIXEL = 0.002  # m


@pytest.fixture
def crowded(scene: Scene) -> Scene:
    """The simple room with a post in the middle."""
    return replace(scene, room=add_post(scene.room, (0.4, 0.4), 0.1, "shelving"))


def test_the_sensor_and_its_beam_handle_can_be_gripped(scene: Scene) -> None:
    x, y = scene.pose.position
    near = (x + 5 * PIXEL, y)
    assert sensor_grip(scene, (0.3, 0.3), near, PIXEL).part is GripPart.SENSOR
    assert sensor_grip(scene, (0.3, 0.3), (0.31, 0.3), PIXEL).part is GripPart.BEAM
    assert sensor_grip(scene, None, (0.31, 0.3), PIXEL) is None


@pytest.mark.parametrize(
    ("at", "part", "name"),
    [
        ((0.003, 0.003), GripPart.CORNER, None),
        ((0.5, 0.003), GripPart.WALL, "bottom"),
        ((0.4, 0.4), GripPart.POST, "post 1"),
        ((0.5, 0.4), GripPart.RIM, "post 1"),
    ],
)
def test_corner_rim_post_and_wall_are_distinguished(
    crowded: Scene, at: tuple[float, float], part: GripPart, name: str
) -> None:
    grip = room_grip(crowded.room, at, PIXEL)
    assert grip.part is part
    assert name is None or crowded.room.names[grip.surface] == name
    assert room_grip(crowded.room, (0.7, 0.6), PIXEL) is None
    assert surface_at(crowded.room, (0.7, 0.6), PIXEL) is None


def test_the_sensor_moves_as_far_as_the_mouse(scene: Scene) -> None:
    x, y = scene.pose.position
    moved, label = dragged(scene, Grip(GripPart.SENSOR, (x + 0.004, y)), (x - 0.096, y + 0.2))
    assert moved.pose.position == pytest.approx((x - 0.1, y + 0.2))
    assert moved.pose.heading == scene.pose.heading
    assert label == "moving the sensor"
    assert moved.room is scene.room  # the room is not computed again


def test_the_sensor_turns_by_the_angle_of_the_drag(scene: Scene) -> None:
    x, y = scene.pose.position
    turned, _ = dragged(scene, Grip(GripPart.BEAM, (x + 0.3, y)), (x, y + 0.1))
    assert math.degrees(turned.pose.heading - scene.pose.heading) == pytest.approx(90)
    back, _ = sensor_turned(turned, -math.pi / 2)
    assert math.degrees(back.pose.heading) % 360 == pytest.approx(math.degrees(scene.pose.heading) % 360)


def test_moving_the_sensor_keeps_the_places_of_the_file(scene: Scene) -> None:
    moved, _ = sensor_at(scene, (0.5, 0.5))
    assert moved.room.places == scene.room.places
    assert moved.pose.name == "0.5,0.5"


def test_a_recording_contains_the_pose_of_the_sensor(scene: Scene, tmp_path: Path) -> None:
    moved, _ = sensor_turned(sensor_at(scene, (0.5, 0.5))[0], math.radians(30))
    log, path = start_recording(tmp_path, moved, warn=print)
    log.close()
    again = scene_of_log(read_log(path).metadata)
    assert again.pose.position == (0.5, 0.5)
    assert math.degrees(again.pose.heading) == pytest.approx(30)
    assert again.room.places.keys() == {*scene.room.places, "0.5,0.5"}


def test_a_slider_of_scatter_keeps_a_table_and_one_of_reflectance_replaces_it(scene: Scene) -> None:
    row = "{ incidence_deg = 0.0, frequency = 50000.0, reflectance = 0.7 }"
    text = scene.room.text.replace("reflectance = 0.95", f"table = [{row}]")
    tabled = replace(scene, room=parse_room(text, "mine.toml"))
    assert surface_text(tabled.room, 0).startswith("bottom · shelving, reflectance up to 0.70")
    rougher, _ = with_material_values(tabled, "shelving", {"scatter": 0.36})
    assert rougher.room.tables.keys() == {"shelving"}
    assert rougher.room.reflectances[0] == pytest.approx(0.7 * 0.8)
    replaced, _ = with_material_values(rougher, "shelving", {"reflectance": 0.5})
    assert not replaced.room.tables
    assert replaced.room.reflectances[0] == pytest.approx(0.5 * 0.8)


@pytest.mark.parametrize("receiver", Receiver)
def test_a_log_uses_the_receiver_of_its_board_profile(scene: Scene, tmp_path: Path, receiver: Receiver) -> None:
    profile = load_board("polaroid-6500").text.replace('receiver = "board"', f'receiver = "{receiver}"')
    log, path = start_recording(tmp_path, replace(scene, board=parse_board(profile, "mine.toml")), warn=print)
    log.close()
    read = scene_of_log(read_log(path).metadata)
    assert read.options.receiver_of(read.board) is receiver


def test_the_sensor_cannot_be_inside_a_post(crowded: Scene) -> None:
    with pytest.raises(InputError, match="cannot be inside post 1"):
        sensor_at(crowded, (0.45, 0.4))
    beside, _ = sensor_at(crowded, (0.6, 0.4))
    post = Grip(GripPart.POST, (0.4, 0.4), crowded.room.names.index("post 1"))
    with pytest.raises(InputError, match="cannot be inside post 1"):
        dragged(beside, post, (0.58, 0.4))
    rim = replace(post, part=GripPart.RIM, point=(0.5, 0.4))
    smaller, label = dragged(beside, rim, (0.45, 0.4))
    assert smaller.room.posts[0, 2] == pytest.approx(0.05)
    assert label == "resizing post 1"


def test_a_sensor_can_be_above_a_low_post() -> None:
    room = load_room(ROOM.with_name("doorstep.toml"))
    board = load_board("polaroid-6500")
    over, _ = sensor_at(Scene(room, room.place("tripod"), board), (0.5, 1.5))
    assert over.pose.position == (0.5, 1.5)
    with pytest.raises(InputError, match="inside bin"):
        sensor_at(Scene(room, room.place("robot"), board), (0.5, 1.5))


def test_a_pose_outside_closed_walls_is_reported(scene: Scene) -> None:
    def outside(room: Room, at: tuple[float, float]) -> bool:
        return "outside the walls" in pose_text(replace(scene, room=room, place=Place("", at)), LengthUnit.M)

    assert not outside(scene.room, (0.4, 0.4))
    assert outside(scene.room, (1.4, 0.4))
    assert not outside(load_room(ROOM.with_name("figure2b.toml")), (5.0, 5.0))
    assert outside(load_room(ROOM.with_name("arena.toml")), (3.0, 3.0))


def test_the_text_of_a_surface_has_its_material_and_loss(scene: Scene) -> None:
    assert surface_text(scene.room, 0) == "bottom · shelving, reflectance 0.95 (−0.4 dB)"
    doorstep: Room = load_room(ROOM.with_name("doorstep.toml"))
    assert surface_text(doorstep, doorstep.names.index("rug")).startswith(
        "rug · rug, reflectance 0.60, scatters 50% (−7.4 dB)"
    )


def test_the_losses_along_a_path_add_up_to_its_gain(crowded: Scene) -> None:
    """For paths over walls, posts, edges, floor and a rough wall."""
    tall = load_room(ROOM.with_name("doorstep.toml"))
    board, headings = load_board("polaroid-6500"), np.radians([0.0, 90.0])
    for scan in (
        predict_scan(crowded.room, crowded.pose, crowded.board, headings),
        predict_scan(tall, tall.place("robot"), board, headings),
    ):
        touched = set()
        for path in range(min(400, len(scan.paths))):
            losses = bounce_losses(scan, path)
            assert sum(loss for _, loss in losses) == pytest.approx(20 * math.log10(scan.paths.gains[path]))
            assert all(1 <= corner <= len(scan.paths.outline(path)) - 2 for corner, _ in losses)
            touched.update(scan.paths.via(path, scan.room))
        assert {"post 1", "bottom"} <= touched or {"floor", "rug", "bin"} <= touched
