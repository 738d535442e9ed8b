"""The content of the window without a window: edits of the scene, texts, and scans for searches."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sonarhw_compare.edits import add_post
from sonarhw_compare.fit import PlacedScan
from sonarhw_compare.locate import PoseSpread
from sonarhw_compare.rooms.evidence import FINE, evidence_of
from sonarhw_gui.jobs.searches import loaded_scans
from sonarhw_gui.model.edits import Grip, GripPart, dragged, room_grip, sensor_at, sensor_grip, sensor_turned
from sonarhw_gui.model.look import LengthUnit
from sonarhw_gui.model.scene import Scene, scene_of_log
from sonarhw_gui.model.shown import Shown, overlaid
from sonarhw_gui.session.scanner import start_recording
from sonarhw_gui.views.echoes import EchoList
from sonarhw_sim.air import Air, Receiver
from sonarhw_sim.board.profile import OwnBodyPart, load_board, parse_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import load_room

from sonarhw.errors import InputError
from sonarhw.log import read_log
from sonarhw.readings import Reading
from tests.fixtures.window_scene import ROOM

SIMPLE = load_room(ROOM)
SCENE = Scene(SIMPLE, SIMPLE.places["figure9"], load_board("polaroid-6500"))
NOWHERE = Scene(None, None, SCENE.board)


@pytest.fixture
def crowded(scene: Scene) -> Scene:
    """The simple room with a post in the middle."""
    return replace(scene, room=add_post(scene.room, (0.4, 0.4), 0.1, "shelving"))


# edits


def test_the_sensor_cannot_be_inside_a_post_but_above_a_low_one(crowded: Scene) -> None:
    with pytest.raises(InputError, match="cannot be inside post 1"):
        sensor_at(crowded, (0.45, 0.4))
    beside, _ = sensor_at(crowded, (0.6, 0.4))
    post = Grip(GripPart.POST, (0.4, 0.4), crowded.room.names.index("post 1"))
    with pytest.raises(InputError, match="cannot be inside post 1"):
        dragged(beside, post, (0.58, 0.4))
    smaller, label = dragged(beside, replace(post, part=GripPart.RIM, point=(0.5, 0.4)), (0.45, 0.4))
    assert smaller.room.posts[0, 2] == pytest.approx(0.05)
    assert label == "resizing post 1"
    room = load_room(ROOM.with_name("doorstep.toml"))
    assert sensor_at(Scene(room, room.place("tripod"), SCENE.board), (0.5, 1.5))[0].pose.position == (0.5, 1.5)
    with pytest.raises(InputError, match="inside bin"):
        sensor_at(Scene(room, room.place("robot"), SCENE.board), (0.5, 1.5))


@pytest.mark.parametrize(
    ("point", "part"),
    [
        ((0.91, 0.7), GripPart.SENSOR),
        ((0.912, 0.7), None),
        ((0.9, 0.59), GripPart.BEAM),
        ((0.9, 0.588), None),
        ((0.4, 0.4), GripPart.POST),
        ((0.49, 0.4), GripPart.POST),
        ((0.492, 0.4), GripPart.RIM),
        ((0.508, 0.4), GripPart.RIM),
        ((0.51, 0.4), None),
        ((0.92, 0.3), GripPart.WALL),
        ((0.918, 0.3), None),
    ],
)
def test_parts_are_gripped_within_pixels(crowded: Scene, point: tuple[float, float], part: GripPart | None) -> None:
    pixel, at = 0.001, sensor_at(crowded, (0.9, 0.7))[0]
    grip = sensor_grip(at, (0.9, 0.6), point, pixel) or room_grip(crowded.room, point, pixel)
    assert part is (grip and grip.part)
    start = crowded.room.walls.reshape(-1, 2, 2)[0, 0]
    assert room_grip(crowded.room, tuple(start + 0.006), pixel).part is GripPart.CORNER


@pytest.mark.parametrize("receiver", Receiver)
def test_a_recording_contains_pose_and_receiver(scene: Scene, tmp_path: Path, receiver: Receiver) -> None:
    profile = SCENE.board.text.replace('receiver = "board"', f'receiver = "{receiver}"')
    moved, _ = sensor_turned(sensor_at(scene, (0.5, 0.5))[0], math.radians(30.14))
    log, path = start_recording(tmp_path, replace(moved, board=parse_board(profile, "mine.toml")), warn=print)
    log.close()
    again = scene_of_log(read_log(path).metadata)
    assert again.pose.position == (0.5, 0.5)
    assert math.degrees(again.pose.heading) == pytest.approx(30.1)  # rounded, for the file
    assert again.room.places.keys() == {*scene.room.places, "0.5,0.5"}
    assert again.options.receiver_of(again.board) is receiver


# texts


def test_all_rows_of_the_list_of_echoes_state_half_of_the_path_also_that_of_the_winner() -> None:
    scan = predict_scan(SIMPLE, SCENE.place, SCENE.board, np.radians([270.0]))
    listed = EchoList(scan, 0, LengthUnit.M)
    half, _, outcome, path = listed.cells(0)
    assert (half, path) == ("0.827 m", "bottom>top>bottom")
    assert outcome == f"wins, receiver adds {float(scan.ranges[0]) - 0.827:.3f} m"
    second = listed.cells(1)
    assert second[2] == f"{float(second[0][:-2]) - 0.827:.3f} m behind the winner"


# scans that a search for the room uses


def sweep(number: int) -> tuple[Reading, ...]:
    return tuple(Reading(k, number, 0, 0.1 * k, float(k), (0.01,), 343.0) for k in range(3))


def test_each_scan_is_used_once_under_a_name_of_its_own_those_with_a_known_place_first() -> None:
    first, second = sweep(0), sweep(1)
    parts = [overlaid("s", part, NOWHERE) for part in (first, second)]
    hidden = replace(overlaid("hidden", sweep(2), NOWHERE), visible=False)
    shown = Shown(NOWHERE, readings=(*first, *second), overlays=(*parts, hidden))
    assert [(scan.name, scan.readings) for scan in loaded_scans(shown, "shown")] == [("s", first), ("s 2", second)]
    assert [scan.name for scan in loaded_scans(replace(shown, overlays=()), "shown")] == ["shown"]
    assert loaded_scans(replace(shown, overlays=(), readings=()), "shown") == ()
    known = loaded_scans(Shown(NOWHERE, readings=first, overlays=(overlaid("k", second, SCENE),)), "shown")
    assert [(scan.name, scan.has_place) for scan in known] == [("k", True), ("shown", False)]
    assert known[0].place is SCENE.place


def test_readings_of_the_own_body_are_left_out_so_that_evidence_belongs_to_the_right_readings() -> None:
    body = OwnBodyPart(from_deg=5.0, to_deg=7.0, nearest=1.0, farthest=2.0)  # contains the reading at 0.1 rad
    scene, readings = replace(NOWHERE, board=replace(NOWHERE.board, own_body=(body,))), sweep(0)
    (scan,) = loaded_scans(Shown(scene, readings=readings), "shown")
    assert scan.readings == (readings[0], readings[2])
    evidence = evidence_of([PlacedScan(readings, scan.place)], [PoseSpread()], scan.board, Air())
    assert len(scan.readings) == len(evidence.by_reading(evidence.first, FINE)[0])


# updates
