"""Whether a scene has unsaved changes: the text that would be saved decides, and a drag of the sensor writes none."""

from dataclasses import replace

import pytest
from sonarhw_gui.model import scene
from sonarhw_gui.model.edits import with_sensor_at
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.session.kept import is_changed, room_text
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import Place, load_room

ROOM = load_room("rooms/simple.toml")
SCENE = Scene(ROOM, ROOM.places["figure9"], load_board("polaroid-6500"))
DRAGGED = with_sensor_at(SCENE, (0.5, 0.4), 0.0)


@pytest.mark.parametrize("opened", [SCENE, DRAGGED])
@pytest.mark.parametrize(
    "now",
    [
        SCENE,
        replace(SCENE, place=ROOM.places["figure7"]),
        replace(SCENE, place=replace(ROOM.places["figure9"], heading=0.1)),
        replace(SCENE, place=replace(ROOM.places["figure9"], position=(0.3, 0.3))),
        replace(SCENE, place=Place("0.5,0.4", (0.500000001, 0.4))),
        with_sensor_at(SCENE, (0.3, 0.3), 0.0),
        with_sensor_at(SCENE, (0.5, 0.4), 0.0),
        Scene(None, None, SCENE.board),
    ],
)
def test_a_scene_is_changed_exactly_if_its_text_is(opened: Scene, now: Scene) -> None:
    assert is_changed(opened, now) == (room_text(opened) != room_text(now))


def test_a_drag_of_the_sensor_writes_no_text(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(room: object, place: object) -> None:
        raise AssertionError("the text of the room was written")

    monkeypatch.setattr(scene, "with_place", refuse)
    for step in range(1, 5):
        assert is_changed(SCENE, with_sensor_at(SCENE, (0.3, 0.1 * step), 0.0))
