"""Maps from scans contain the room without the false walls of multipath echoes."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from sonarhw_cli.app import run
from sonarhw_compare.arcs import Arc
from sonarhw_compare.fit import PlacedScan
from sonarhw_compare.map import certainty_grid, find_features, map_scans, room_of, with_possible_walls
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, Room, load_room

from sonarhw.errors import InputError
from sonarhw.readings import Reading
from tests.fixtures.rooms_for_tests import polygon_room

BOARD = load_board("paper")
SPEED = 344.0


def reading(number: int, degrees: float, distance: float) -> Reading:
    times = () if math.isnan(distance) else (2 * distance / SPEED,)
    return Reading(number, 0, 0, math.radians(degrees), 0.0, times, SPEED)


def scan_from(room: Room, position: tuple[float, float]) -> PlacedScan:
    place, degrees = Place("", position), np.arange(0.0, 360.0, 2.0)
    ranges = predict_scan(room, place, BOARD, np.radians(degrees)).ranges.tolist()
    return PlacedScan([reading(k, *pair) for k, pair in enumerate(zip(degrees.tolist(), ranges, strict=True))], place)


def arc(centre: tuple[float, float], target: tuple[float, float]) -> Arc:
    """Return an arc with its middle at a target."""
    dx, dy = np.subtract(target, centre)
    return Arc(0, (), centre, math.hypot(dx, dy), math.atan2(dy, dx), math.radians(8))


def test_a_map_contains_the_room_without_its_images() -> None:
    """Without a room, sound is followed in a room of the found walls."""
    room = polygon_room([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 2.0)])
    scans = [scan_from(room, position) for position in ((0.8, 0.7), (1.5, 1.3), (2.2, 0.9), (1.2, 0.6))]
    found = map_scans(scans, BOARD)
    assert sorted(round(math.degrees(wall.normal)) % 360 for wall in found.direct.features.walls) == [0, 90, 180, 270]
    for wall in found.direct.features.walls:
        across = 0 if round(math.degrees(wall.normal)) % 180 == 0 else 1
        assert min(abs(wall.start[across] - at) for at in (0.0, (3.0, 2.0)[across])) < 0.005
    corners = sorted((round(x + 0.0, 1) + 0.0, round(y, 1) + 0.0) for x, y in positions(found.direct.features.points))
    assert corners == [(0.0, 0.0), (0.0, 2.0), (3.0, 0.0), (3.0, 2.0)]
    assert all(point.is_corner for point in found.direct.features.points)
    # with all readings, corners appear two metres outside the walls
    assert any(not -0.1 < y < 2.1 for _, y in positions(found.plain.features.points))
    assert found.rejected > 0


def positions(points: object) -> list[tuple[float, float]]:
    return [point.position for point in points]  # type: ignore[attr-defined]


def test_the_false_wall_of_figure_9_is_rejected() -> None:
    room = load_room("rooms/simple.toml")
    scan = scan_from(room, room.places["figure9"].position)
    found = map_scans([scan], BOARD, room)
    down = 135  # the reading at 270°, where the wall is at 85 mm and the range is 827 mm
    assert scan.readings[down].range == pytest.approx(0.827, abs=0.002)
    assert not found.direct.kept[0][down]
    assert found.direct.kept[0][45]
    false_wall = np.array([[0.774, 0.085 - 0.827]])
    assert found.plain.grid.at(false_wall)[0] > 0
    assert found.direct.grid.at(false_wall)[0] <= 0
    assert found.direct.grid.at(np.array([[0.774, 0.742]]))[0] > 0


def test_a_reading_marks_its_cone_empty_and_its_end_occupied() -> None:
    scan = PlacedScan([reading(0, 90.0, 1.0), reading(1, 0.0, math.nan)], Place("", (0.2, 0.1)))
    grid = certainty_grid([scan], BOARD, [np.ones(2, dtype=np.bool_)])
    on_axis, at_end, aside, behind, silent = grid.at(
        np.array([[0.2, 0.6], [0.2, 1.1], [0.6, 0.6], [0.2, 1.3], [0.7, 0.1]])
    )
    assert on_axis < -0.5
    assert at_end > 0.9
    assert (aside, behind, silent) == (0, 0, 0)


def test_an_empty_cell_is_not_occupied_by_another_reading() -> None:
    """Two points on the arc of a near reading, equally far from its axis; a far reading passes through one of them."""
    place, near, far = Place("", (0.0, 0.0)), reading(0, 10.0, 0.6), reading(1, 0.0, 1.5)
    spots = [[0.6 * math.cos(math.radians(at)), 0.6 * math.sin(math.radians(at))] for at in (2.0, 18.0)]

    def filled(*readings: Reading) -> list[float]:
        grid = certainty_grid([PlacedScan(readings, place)], BOARD, [np.ones(len(readings), dtype=np.bool_)], 0.005)
        column, row = np.floor((np.array(spots) - (grid.left, grid.bottom)) / grid.cell).astype(int).T
        return grid.occupied[row, column].tolist()

    seen_through, beside = filled(near)
    assert seen_through == pytest.approx(beside, rel=0.05)
    seen_through, beside = filled(near, far)
    assert seen_through < 0.5 * beside


def test_two_places_distinguish_a_wall_from_a_point() -> None:
    centres = [(0.0, 0.0), (0.6, 0.1)]
    wall = find_features([arc(centre, (centre[0], 1.0)) for centre in centres])
    assert [round(math.degrees(one.normal)) for one in wall.walls] == [90]
    np.testing.assert_allclose([wall.walls[0].start[1], wall.walls[0].end[1]], 1.0, atol=1e-6)
    point = find_features([arc(centre, (0.4, 1.0)) for centre in centres])
    (found,) = point.points
    np.testing.assert_allclose(found.position, (0.4, 1.0), atol=1e-6)
    assert not found.is_corner


def test_one_place_gives_arcs_only() -> None:
    features = find_features([arc((0.0, 0.0), (0.0, 1.0)), arc((0.01, 0.0), (0.01, 1.0))])
    assert (features.walls, features.points) == ((), ())
    assert len(features.alone) == 2


@pytest.mark.parametrize(
    ("x", "behind", "possible"),
    [
        (0.45, 1.0, True),
        (0.06, 1.0, True),
        (0.04, 1.0, False),
        (0.84, 1.0, True),
        (0.86, 1.0, False),
        (0.45, 0.11, True),
        (0.45, 0.09, False),
        (0.45, -0.4, False),
        (1.5, 1.0, False),
    ],
)
def test_a_wall_through_which_a_scan_detects_echoes_is_possible_only(x: float, behind: float, possible: bool) -> None:
    centres = [(0.0, 0.0), (0.4, 0.1), (0.9, 0.05)]
    features = find_features([arc(centre, (centre[0], 1.0)) for centre in centres])
    looking_up = PlacedScan([reading(k, 84.0 + 3 * k, 0.8 + behind) for k in range(5)], Place("", (x, 0.2)))
    marked = with_possible_walls(features, [looking_up], BOARD, [np.ones(5, dtype=np.bool_)])
    assert [wall.possible for wall in marked.walls] == [possible]
    assert (room_of(marked) is None) == possible


def test_a_map_without_paths_for_most_echoes_gives_a_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scan = str(tmp_path / "scan.mcap")
    assert run(["simulate", "arena", "--place", "p3", "--step", "6", "--out", scan]) == 0
    for room, place, warned in (("arena", "p3", False), ("corridor", "5.0,0.4", True)):
        assert run(["map", scan, "--room", room, "--place", place]) == 0
        assert ("of 60 echoes have no path in this room" in capsys.readouterr().err) == warned


def test_scans_without_an_echo_are_rejected() -> None:
    silent = PlacedScan([reading(0, 0.0, math.nan)], Place("", (0.0, 0.0)))
    with pytest.raises(InputError, match="no reading has an echo"):
        map_scans([silent], BOARD)


def test_the_command_reads_logs_and_writes_picture_and_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    logs, picture = [str(tmp_path / "one.mcap"), str(tmp_path / "two.mcap")], tmp_path / "map.png"
    for log, place in zip(logs, ("figure7", "figure9"), strict=True):
        assert run(["simulate", "rooms/simple.toml", "--place", place, "--board", "paper", "--out", log]) == 0
    assert run(["map", *logs, "--room", "rooms/simple.toml", "--out", str(picture), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert printed["readings"] == 144
    assert printed["rejected"] > 0
    left = [wall for wall in printed["direct"]["walls"] if abs(wall["normal_deg"] - 180) < 3]
    assert left[0]["start_m"][0] == pytest.approx(0.0, abs=0.01)
    assert run(["map", *logs, "--pose", "0.8,0.3,0", "--json"]) == 2
    assert "--pose: expected one for each of 2 logs, got 1" in capsys.readouterr().err
    assert run(["map", *logs, "--room", "rooms/kuc_siegel.toml", "--json"]) == 2
    assert "contains no place in room" in capsys.readouterr().err
    assert (printed["places"], printed["confirmed"]) == (2, False)


@pytest.fixture(scope="module")
def simple_logs(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Return logs of two places in an empty rectangular room."""
    folder, logs = tmp_path_factory.mktemp("map"), []
    for place in ("figure9", "0.3,0.4"):
        logs.append(str(folder / f"{place}.mcap"))
        order = ["--place", place, "--board", "paper", "--step", "3", "--out", logs[-1]]
        assert run(["simulate", "rooms/simple.toml", *order]) == 0
    return logs


@pytest.mark.parametrize("count", [1, 2])
def test_fewer_than_three_places_give_a_warning_and_only_possible_features(
    count: int, simple_logs: list[str], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    picture = tmp_path / "map.svg"
    capsys.readouterr()
    assert run(["map", *simple_logs[:count], "--out", str(picture)]) == 0
    printed = capsys.readouterr()
    assert f"warning: scans from {count} place" in printed.err
    walls = re.search(r"(\d+) possible walls?", printed.out)
    assert walls is not None
    # it is not determined which echoes came by several reflections, so their number is not given
    assert "removed" not in printed.out
    assert f"not determined which of {count * 120} readings came by several reflections" in printed.out
    drawn = picture.read_text()
    assert ("<!-- possible wall -->" in drawn) == (walls[1] != "0")
    assert "<!-- wall -->" not in drawn
    assert "<!-- not determined which came by several reflections -->" in drawn


def test_readings_without_a_path_are_counted_as_not_determined() -> None:
    room = polygon_room([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 2.0)])
    scan = scan_from(room, (0.8, 0.7))
    # the same room, but its right wall is 10 cm farther: paths off that wall do not explain these echoes
    other = polygon_room([(0.0, 0.0), (3.1, 0.0), (3.1, 2.0), (0.0, 2.0)])
    right, wrong = map_scans([scan], BOARD, room), map_scans([scan], BOARD, other)
    assert right.echoes == wrong.echoes > 0
    assert right.undetermined == 0
    assert 0 < wrong.undetermined < wrong.echoes


def test_the_document_shows_the_output_of_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    printed = Path("docs/comparing/map.md").read_text().split("--out map.png\nmap.png: written\n")[1].split("```")[0]
    logs = [str(tmp_path / f"scan{k}.mcap") for k in range(4)]
    for log, place in zip(logs, ("0.8,0.8", "1.6,1.4", "2.4,0.9", "1.3,0.5"), strict=True):
        assert run(["simulate", "rooms/kuc_siegel.toml", "--place", place, "--step", "2", "--out", log]) == 0
    assert run(["map", *logs, "--room", "rooms/kuc_siegel.toml", "--out", str(tmp_path / "map.png")]) == 0
    assert capsys.readouterr().out == printed


@pytest.mark.parametrize("has_body", [True, False])
def test_echoes_that_are_the_same_at_most_places_may_be_of_the_carrier(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], has_body: bool
) -> None:
    room = polygon_room([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 2.0)])
    command = ["map", "--json", "--board", "paper"]
    for number, (x, y) in enumerate(((0.8, 0.7), (1.5, 1.3), (2.2, 0.9), (1.2, 0.6))):
        table, log = tmp_path / f"{number}.csv", tmp_path / f"{number}.mcap"
        lines = ["deg,m"]
        for one in scan_from(room, (x, y)).readings:
            of_body = has_body and 20 <= math.degrees(one.angle) <= 50
            lines.append(f"{math.degrees(one.angle):.0f},{0.2 if of_body else one.range or 99}")
        table.write_text("\n".join(lines))
        columns = ["--heading", "deg", "--range", "m", "--no-echo", "99"]
        assert run(["import", str(table), "--out", str(log), *columns]) == 0
        command += [str(log), "--pose", f"{x},{y},0"]
    capsys.readouterr()
    assert run(command) == 0
    warning = "echoes from 0.17 to 0.23 m at turntable angles 19° to 51° are the same at most places"
    assert (warning in capsys.readouterr().err) == has_body
