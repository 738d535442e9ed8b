"""Rooms from files of other programs: where walls, posts and places are, units, and what is refused."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
from PIL import Image
from sonarhw_sim.check import plan_findings
from sonarhw_sim.room.room import Room, wall_distances

import sonarhw
from sonarhw.errors import InputError

Writer = Callable[[Path], Path]

# Each file describes the same room: four walls of 3.2 by 2.4 m, a box of 0.4 m turned by 30°, and a post.
CORNERS = np.array([[0.0, 0.0], [3.2, 0.0], [3.2, 2.4], [0.0, 2.4]])
BOX, TURN = np.array([2.4, 0.6]), math.radians(30)
POST = (0.8, 1.6, 0.15)
SDF = """<?xml version="1.0"?><sdf version="1.7"><world name="w">
<include><uri>model://ground_plane</uri></include>
{walls}
<model name="box"><pose>2.4 0.6 0.2 0 0 0.5235987755982988</pose><link name="l"><collision name="c">
<geometry><box><size>0.4 0.4 0.4</size></box></geometry></collision></link></model>
<model name="group"><pose>0.5 1.5 0 0 0 1.5707963</pose>
<model name="post"><pose degrees="true">0.1 -0.3 1 180 0 0</pose>
<link name="l"><visual name="v"><geometry><cylinder><radius>0.15</radius><length>2</length></cylinder></geometry>
</visual></link></model></model>
<model name="robot"><pose>1.6 0.12 0.1 0 0 0.7853981633974483</pose><link name="l">
<collision name="c"><geometry><box><size>0.2 0.2 0.2</size></box></geometry></collision>
<sensor name="s" type="ray"><pose>0.1 0 0.05 0 0 0</pose></sensor></link></model></world></sdf>"""
SDF_WALL = (
    '<model name="wall {n}"><static>1</static><link name="l"><pose>{x} {y} 1.25 0 0 {yaw}</pose><collision name="c">'
    "<geometry><box><size>{length} 0.1 2.5</size></box></geometry></collision></link></model>"
)
STAGE = """# a world
include "missing.inc"
define post_like model ( size [0.4 0.4 1] )
define floorplan model ( boundary 1 )
floorplan ( name "plan" size [3.2 2.4 1] pose [1.6 1.2 0 0] bitmap "plan.png"
  post_like ( name "box" pose [0.8 -0.6 0 30] ) )
position ( name "robot" pose [1.6 0.12 0 45] )
"""


def _box_corners() -> np.ndarray:
    square = np.array([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    turn = np.array([[math.cos(TURN), math.sin(TURN)], [-math.sin(TURN), math.cos(TURN)]])
    return np.asarray(square @ turn + BOX)


def _gazebo(folder: Path) -> Path:
    # walls of 0.1 m whose ends overlap at the corners, as the building editor makes them
    sides = ((1.6, -0.05, 0, 3.4), (3.25, 1.2, 1.5708, 2.6), (1.6, 2.45, 0, 3.4), (-0.05, 1.2, 1.5708, 2.6))
    walls = "".join(SDF_WALL.format(n=n, x=x, y=y, yaw=yaw, length=s) for n, (x, y, yaw, s) in enumerate(sides))
    file = folder / "room.world"
    file.write_text(SDF.format(walls=walls))
    return file


def _stage(folder: Path) -> Path:
    cells = np.full((240, 320), 255, np.uint8)
    y, x = np.mgrid[0:240, 0:320]
    cells[np.hypot(x + 0.5 - 80, 240 - y - 0.5 - 160) < 15] = 0
    cells[[0, -1], :] = cells[:, [0, -1]] = 0
    Image.fromarray(cells).save(folder / "plan.png")
    file = folder / "room.world"
    file.write_text(STAGE)
    return file


def _ros(folder: Path) -> Path:
    """A map with cells of 2 cm, unknown outside, and its origin at -0.5, -0.5 m."""
    x, y = (np.mgrid[0:170, 0:210][::-1] + 0.5) * 0.02 - 0.5
    inside = (x > 0) & (x < 3.2) & (y > 0) & (y < 2.4)
    wall = ~inside & (x > -0.06) & (x < 3.26) & (y > -0.06) & (y < 2.46)
    along = (np.dstack((x, y)) - BOX) @ np.array([[math.cos(TURN), -math.sin(TURN)], [math.sin(TURN), math.cos(TURN)]])
    solid = (np.abs(along) < 0.2).all(axis=2) | (np.hypot(x - POST[0], y - POST[1]) < POST[2])
    cells = np.where(wall | solid, 0, np.where(inside, 254, 205)).astype(np.uint8)
    Image.fromarray(np.flipud(cells)).save(folder / "map.pgm")
    file = folder / "map.yaml"
    file.write_text(
        "image: map.pgm  # beside it\nmode: trinary\nresolution: 0.02\norigin:\n- -0.5\n- -0.5\n- 0\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return file


def _dxf(folder: Path, code: int = 4, scale: float = 1000.0) -> Path:
    document = ezdxf.new()  # type: ignore[attr-defined]
    document.header["$INSUNITS"] = code
    space = document.modelspace()
    for start, end in zip(CORNERS, np.roll(CORNERS, -1, axis=0), strict=True):
        space.add_line(start * scale, end * scale)
    space.add_line(CORNERS[0] * scale, CORNERS[1] * scale)  # drawn twice
    chair = document.blocks.new("CHAIR")
    half = 0.2 * scale
    chair.add_lwpolyline([(-half, -half), (half, -half), (half, half), (-half, half)], close=True)
    space.add_blockref("CHAIR", BOX * scale, dxfattribs={"rotation": 30})
    space.add_circle((POST[0] * scale, POST[1] * scale), POST[2] * scale)
    space.add_text("a room")
    file = folder / "room.dxf"
    document.saveas(file)
    return file


def _svg(folder: Path, size: str = 'width="3200mm" height="2400mm"') -> Path:
    file = folder / "room.svg"
    file.write_text(
        f'<?xml version="1.0"?><!DOCTYPE svg><svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="0 0 320 240" '
        'xmlns:xlink="http://www.w3.org/1999/xlink"><defs><rect id="b" x="-20" y="-20" width="40" height="40"/></defs>'
        '<path d="M 0 0 h 320 v 240 h -320 z"/><g transform="translate(240 180)"><use xlink:href="#b" '
        'transform="rotate(-30)"/></g><circle cx="80" cy="80" r="15"/><text>a room</text></svg>'
    )
    return file


def _geojson(folder: Path) -> Path:
    """Longitude and latitude around 8.4°, 49°; an octagon of many corners is no post."""
    metres = math.radians(1.0) * 6_371_008.8
    rings = [[*ring, ring[0]] for ring in (CORNERS.tolist(), _box_corners().tolist())]
    features = [
        {
            "type": "Feature",
            "properties": {"indoor": "room"},
            "geometry": {
                "type": "Polygon",
                "coordinates": [
                    [[8.4 + x / metres / math.cos(math.radians(49.00001)), 49 + y / metres] for x, y in ring]
                ],
            },
        }
        for ring in rings
    ]
    file = folder / "room.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return file


def _farthest(points: np.ndarray, room: Room) -> float:
    return float(wall_distances(points, room.walls).min(axis=1).max())


@pytest.mark.parametrize(
    ("write", "error", "posts", "places", "shift"),
    [
        (_gazebo, 1e-3, 1, ["robot"], (0.0, 0.0)),
        (_stage, 0.02, 1, ["robot"], (0.0, 0.0)),
        (_ros, 0.02, 1, [], (0.0, 0.0)),
        (_dxf, 1e-6, 1, [], (0.0, 0.0)),
        (_svg, 1e-6, 1, [], (0.0, 0.0)),
        (_geojson, 1e-3, 0, [], (-1.6, -1.2)),
    ],
)
def test_a_room_of_each_format_has_its_walls_posts_and_places(
    write: Writer, error: float, posts: int, places: list[str], shift: tuple[float, float], tmp_path: Path
) -> None:
    imported = sonarhw.import_room(write(tmp_path))
    room = imported.room
    assert [finding.line for finding in plan_findings(room)] == []
    corners = np.vstack((CORNERS, _box_corners())) + shift
    middles = (corners + np.vstack((np.roll(corners[:4], -1, axis=0), np.roll(corners[4:], -1, axis=0)))) / 2
    assert _farthest(np.vstack((corners, middles)), room) < error
    inner = np.array([[1.0, 0.5], [1.5, 2.0], [3.0, 2.2]]) + shift
    assert wall_distances(inner, room.walls).min() > 0.05  # no wall where none is
    assert len(room.posts) == posts
    if posts:
        np.testing.assert_allclose(room.posts[0], POST, atol=error)
    assert list(room.places) == places
    assert all(f"# {note}" in room.text for note in imported.notes)
    assert any("reflectance 0.9 assumed" in note for note in imported.notes)


def test_a_sensor_of_gazebo_and_a_robot_of_stage_are_places_with_headings(tmp_path: Path) -> None:
    for write, ahead in ((_gazebo, 0.1), (_stage, 0.0)):
        place = sonarhw.import_room(write(tmp_path)).room.places["robot"]
        along = ahead * math.sqrt(0.5)
        assert place.position == pytest.approx((1.6 + along, 0.12 + along), abs=1e-6)
        assert math.degrees(place.heading) == pytest.approx(45)


def test_at_a_height_only_what_reaches_it_is_there(tmp_path: Path) -> None:
    high = sonarhw.import_room(_gazebo(tmp_path), height=0.6)
    assert _farthest(_box_corners(), high.room) > 0.1
    assert any("at a height of 0.6 m; 1 object" in note for note in high.notes)


_HUGE_BOX = (
    "<sdf version='1.6'><world name='w'><model name='m'><static>1</static><link name='l'><collision name='c'><geometry>"
    "<box><size>1e308 1 1</size></box></geometry></collision></link></model></world></sdf>"
)


@pytest.mark.parametrize(
    ("write", "options", "expected"),
    [
        (lambda folder: _dxf(folder, 0), {}, "states no length unit ($INSUNITS 0), and it is 3200 by 2400 units; give"),
        (lambda folder: _dxf(folder, 0), {"unit": "ell"}, "unit 'ell': expected one of m, cm, mm"),
        (lambda folder: _svg(folder, ""), {}, "mm: 0.32 by 0.24 m"),
        (_dxf, {"layers": ["WALLS"]}, "no layer 'WALLS' with lines; layers: 0"),
        (_gazebo, {"unit": "mm"}, "unit: room.world is in metres"),
        (lambda to: _text(to, '{"type": "Polygon", "coordinates": [[[0, 0], [3, 0], [3, 2]]]}'), {}, "give the unit"),
        (lambda folder: _text(folder, "image: none.pgm\nresolution: 0.05\n"), {}, "none.pgm: no such file"),
        (lambda folder: _text(folder, "<robot name='r'/>"), {}, "is XML with the element <robot>"),
        (lambda folder: _text(folder, _HUGE_BOX), {}, "<size>: expected 3 numbers up to 1e9, got '1e308 1 1'"),
        (lambda folder: _text(folder, "1,2\n3,4\n"), {}, "is not recognised; expected a map of ROS"),
        (lambda folder: _text(folder, "AC1032"), {}, "is a DWG drawing; save it as DXF"),
    ],
)
def test_the_undecided_is_a_question(write: Writer, options: dict[str, Any], expected: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        sonarhw.import_room(write(tmp_path), **options)
    assert expected in str(refused.value)


def _text(folder: Path, text: str) -> Path:
    file = folder / "room.txt"
    file.write_text(text)
    return file


@pytest.mark.parametrize(("code", "scale"), [(1, 1 / 0.0254), (2, 1 / 0.3048), (5, 100.0), (6, 1.0)])
def test_the_unit_of_a_dxf_is_read(code: int, scale: float, tmp_path: Path) -> None:
    assert _farthest(CORNERS, sonarhw.import_room(_dxf(tmp_path, code, scale)).room) < 1e-6


def test_a_stated_unit_replaces_the_question(tmp_path: Path) -> None:
    assert _farthest(CORNERS, sonarhw.import_room(_svg(tmp_path, ""), unit="cm").room) < 1e-6
    assert _farthest(CORNERS, sonarhw.import_room(_dxf(tmp_path, 0), unit="0.001").room) < 1e-6


def test_repeated_elements_beyond_number_are_refused(tmp_path: Path) -> None:
    levels = "".join(f'<g id="g{k}">' + f'<use href="#g{k - 1}"/>' * 10 + "</g>" for k in range(1, 12))
    file = _text(
        tmp_path, f'<svg xmlns="http://www.w3.org/2000/svg"><defs><g id="g0"/>{levels}</defs><use href="#g11"/></svg>'
    )
    with pytest.raises(InputError, match="<use> repeats more than"):
        sonarhw.import_room(file, unit="m")
