"""Maps from scans contain the room without the false walls of multipath echoes."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from sonarhw_cli.app import run
from sonarhw_compare.fit import PlacedScan
from sonarhw_compare.map import map_scans
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import Place, load_room

from sonarhw.errors import InputError
from tests.fixtures.predicted_readings import predicted_readings, predicted_scan, readings_of
from tests.fixtures.rooms_for_tests import polygon_room

BOARD = load_board("paper")


def test_a_map_contains_the_room_without_its_images() -> None:
    """Without a room, sound is followed in a room of the found walls."""
    room = polygon_room([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 2.0)])
    scans = [
        predicted_scan(room, Place("", position), BOARD, 2.0)
        for position in ((0.8, 0.7), (1.5, 1.3), (2.2, 0.9), (1.2, 0.6))
    ]
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
    scan = predicted_scan(room, room.places["figure9"], BOARD, 2.0)
    found = map_scans([scan], BOARD, room)
    down = 135  # the reading at 270°, where the wall is at 85 mm and the range is 827 mm
    assert scan.readings[down].range == pytest.approx(0.827, abs=0.002)
    assert not found.direct.kept[0][down]
    assert found.direct.kept[0][45]
    false_wall = np.array([[0.774, 0.085 - 0.827]])
    assert found.plain.grid.at(false_wall)[0] > 0
    assert found.direct.grid.at(false_wall)[0] <= 0
    assert found.direct.grid.at(np.array([[0.774, 0.742]]))[0] > 0


def test_a_map_without_paths_gives_a_warning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scan = str(tmp_path / "scan.mcap")
    assert run(["simulate", "arena", "--place", "p3", "--step", "6", "--out", scan]) == 0
    for room, place, warned in (("arena", "p3", False), ("corridor", "5.0,0.4", True)):
        assert run(["map", scan, "--room", room, "--place", place]) == 0
        assert ("of 60 echoes have no path in this room" in capsys.readouterr().err) == warned


def test_scans_without_an_echo_are_rejected() -> None:
    silent = PlacedScan(readings_of([0.0], [math.nan]), Place("", (0.0, 0.0)))
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
    # it is not determined which echoes came by several reflections, so their number is not given
    assert "removed" not in printed.out
    assert f"not determined which of {count * 120} readings came by several reflections" in printed.out
    drawn = picture.read_text()
    assert ("<!-- possible wall -->" in drawn) == (walls[1] != "0")
    assert "<!-- wall -->" not in drawn
    assert "<!-- not determined which came by several reflections -->" in drawn


def test_readings_without_a_path_are_counted_as_not_determined() -> None:
    room = polygon_room([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 2.0)])
    scan = predicted_scan(room, Place("", (0.8, 0.7)), BOARD, 2.0)
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
def test_echoes_may_be_of_the_carrier(tmp_path: Path, capsys: pytest.CaptureFixture[str], has_body: bool) -> None:
    room = polygon_room([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 2.0)])
    command = ["map", "--json", "--board", "paper"]
    for number, (x, y) in enumerate(((0.8, 0.7), (1.5, 1.3), (2.2, 0.9), (1.2, 0.6))):
        table, log = tmp_path / f"{number}.csv", tmp_path / f"{number}.mcap"
        lines = ["deg,m"]
        for one in predicted_readings(room, Place("", (x, y)), BOARD, 2.0):
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
