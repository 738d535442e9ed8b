"""A room is found from scans of it, and predicts scans that it was not found from."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from sonarhw_cli.app import run
from sonarhw_compare.rooms.search import find_room
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, Room, load_room

from tests.fixtures.predicted_readings import predicted_scan

# an L: six walls, one of them hidden from each place
CORNERS = [(0.0, 0.0), (3.0, 0.0), (3.0, 1.4), (1.8, 1.4), (1.8, 2.4), (0.0, 2.4)]
PLACES = {"a": (0.6, 0.7), "b": (1.2, 1.9), "c": (2.4, 0.6), "d": (1.3, 0.9)}
OFF = (0.02, -0.015)  # m, error of one place, 25 mm
NEAR, TURNED = 0.01, math.radians(1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A room file, and a log from each place."""
    folder = tmp_path_factory.mktemp("scans")
    places = "".join(f"[places.{name}]\nposition = {list(at)}\n" for name, at in PLACES.items())
    (folder / "true.toml").write_text(
        f'name = "L"\n[materials.wall]\nreflectance = 0.9\n[[walls]]\nname = "w"\nmaterial = "wall"\nclosed = true\n'
        f"points = {[list(corner) for corner in CORNERS]}\n{places}"
    )
    for name in PLACES:
        command = ["simulate", str(folder / "true.toml"), "--place", name, "--step", "5"]
        assert run([*command, "--out", str(folder / f"{name}.mcap")]) == 0
    return folder


def missing_walls(found: Room) -> list[int]:
    """Return the true walls whose middle third no found wall covers within 1 cm and 1°."""
    missing = []
    for number, (start, end) in enumerate(zip(CORNERS, CORNERS[1:] + CORNERS[:1], strict=True)):
        points = [np.add(start, share * np.subtract(end, start)) for share in (0.35, 0.5, 0.65)]
        angle = math.atan2(end[1] - start[1], end[0] - start[0])
        if not any(covers(wall, points, angle) for wall in found.walls):
            missing.append(number)
    return missing


def covers(wall: np.ndarray, points: list[np.ndarray], angle: float) -> bool:
    start, along = wall[:2], wall[2:] - wall[:2]
    length = float(np.hypot(*along))
    at = [float((point - start) @ along) / length for point in points]
    normal = np.array([-along[1], along[0]])
    away = [abs(float((point - start) @ normal)) / length for point in points]
    turned = abs(math.remainder(math.atan2(along[1], along[0]) - angle, math.pi))
    return turned < TURNED and max(away) < NEAR and all(0 <= one <= length for one in at)


def logs(folder: Path, names: str = "abcd") -> list[str]:
    return [str(folder / f"{name}.mcap") for name in names]


def test_a_room_predicts_another_scan(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    room_file, picture, report = (tmp_path / f"found.{suffix}" for suffix in ("toml", "svg", "html"))
    files = [word for file in (room_file, picture, report) for word in ("--out", str(file))]
    assert run(["map", *logs(folder), *files]) == 0
    # the found room is first, because the baseline names other numbers of walls
    printed, _, baseline = capsys.readouterr().out.partition("baseline, ")
    walls, explained, echoes = map(int, re.findall(r"^found room: (\d+) walls, .*; (\d+) of (\d+) echoes", printed)[0])
    assert re.search(r"^all readings: .* walls", baseline, flags=re.MULTILINE)
    found = load_room(room_file)
    assert missing_walls(found) == []
    assert explained >= 0.9 * echoes
    assert walls == len(found.walls)
    drawn, page = picture.read_text(encoding="utf-8"), report.read_text(encoding="utf-8")
    assert all(f"<!-- {name} -->" in drawn for name in found.names)
    assert "<!-- beside L -->" in drawn  # the room in the logs
    # the report has the found room and the baseline, one picture each, and a row for each wall
    assert re.findall("data:image/([a-z]+)", page) == ["svg", "png"]
    rows = [re.findall("<td>([^<]*)</td>", row) for row in page.split("<tr>")]
    listed = {row[0]: (row[1], row[2]) for row in rows if len(row) == 6 and row[0].startswith("wall")}
    assert listed == {
        name: (f"{x:.3f}, {y:.3f}", f"{x2:.3f}, {y2:.3f}")
        for name, (x, y, x2, y2) in zip(found.names, found.walls.tolist(), strict=False)
    }
    assert [row[0] for row in rows if row[:1] and row[0].startswith("baseline")] != []
    assert list(found.places) == list(PLACES)
    assert "±" in room_file.read_text(encoding="utf-8")

    board, headings = load_board("polaroid-6500"), np.radians(np.arange(0.0, 360.0, 3.0))
    elsewhere = Place("", (0.9, 1.3))
    ranges = [predict_scan(one, elsewhere, board, headings).ranges for one in (load_room(folder / "true.toml"), found)]
    assert np.nanmean(np.abs(ranges[0] - ranges[1]) < 0.05) > 0.85


def test_unknown_places_are_found(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    x, y = np.add(PLACES["b"], OFF)
    poses, room_file = tmp_path / "poses.csv", tmp_path / "found.toml"
    header = "log,x_m,y_m,heading_deg,sd_xy_m,sd_heading_deg"
    poses.write_text(f"{header}\na.mcap,0.6,0.7,0,,\nb.mcap,{x},{y},0,0.03,1\nd.mcap,,,,,")
    given = logs(folder, "abd")
    command = ["map", *given, "--poses", str(poses), "--out", str(room_file), "--json"]
    assert run([*command, "--effort", "quick"]) == 0
    found = load_room(room_file).places
    for name in "abd":
        assert math.dist(found[name].position, PLACES[name]) < 1.5 * NEAR
        assert abs(math.remainder(found[name].heading, math.tau)) < TURNED
    figures = json.loads(capsys.readouterr().out)["found"]
    assert figures["left_out"] == []
    assert list(figures["poses"]) == [given[2]]
    assert figures["poses"][given[2]][0]["probability"] > 0.9


def test_written_positions_determine_a_room(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    poses, room_file = tmp_path / "poses.csv", tmp_path / "found.toml"
    rows = [f"{name}.mcap,{x},{y},,0.03," for name, (x, y) in PLACES.items()]
    poses.write_text("\n".join(["log,x_m,y_m,heading_deg,sd_xy_m,sd_heading_deg", *rows]))
    assert run(["map", *logs(folder), "--poses", str(poses), "--out", str(room_file), "--effort", "quick"]) == 0
    found = load_room(room_file)
    assert missing_walls(found) == []
    assert max(abs(math.remainder(found.places[name].heading, math.tau)) for name in PLACES) < TURNED
    assert "scan next at " in capsys.readouterr().out


def test_no_room_is_written_unless_wanted(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given, file = [str(tmp_path / f"{name}.mcap") for name in "ac"], tmp_path / "found.toml"
    for name, log in zip("ac", given, strict=True):
        command = ["simulate", str(folder / "true.toml"), "--place", name, "--step", "10", "--board", "hc-sr04"]
        assert run([*command, "--out", log]) == 0
    capsys.readouterr()
    command = ["map", *given, "--pose", "0.6,0.7,0", "--pose", "1.2,1.5,130"]  # the second is wrong
    command += ["--effort", "quick", "--out", str(file)]
    assert run([*command, "--json"]) == 1
    printed = capsys.readouterr()
    verdict = json.loads(printed.out)["found"]["verdict"]
    assert (verdict["is_room"], file.exists()) == (False, False)
    assert f"this is probably not a room: {verdict['reasons'][0]}" in printed.err
    assert run([*command, "--anyway"]) == 0
    assert file.exists()
    assert "not a room: " in capsys.readouterr().out


def test_a_deaf_sensor_is_found(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    board = load_board("hc-sr04")
    stated = f"threshold_db = {board.threshold_db}"
    assert stated in board.text
    of_population, deaf, room_file = tmp_path / "population.toml", tmp_path / "deaf.toml", tmp_path / "found.toml"
    of_population.write_text(board.text.replace(stated, f"threshold_sd_db = 4.0\n{stated}"))
    deaf.write_text(board.text.replace(stated, f"threshold_db = {board.threshold_db + 8.0}"))
    scans = [str(tmp_path / f"{name}.mcap") for name in "ac"]
    for name, scan in zip("ac", scans, strict=True):
        command = ["simulate", str(folder / "true.toml"), "--place", name, "--board", str(deaf), "--step", "5"]
        assert run([*command, "--out", scan]) == 0
    capsys.readouterr()
    assert run(["map", *scans, "--board", str(of_population), "--out", str(room_file), "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)["found"]
    # at the stated threshold, the end of a wall that faces no place would return echoes, and is left out
    assert (len(load_room(room_file).walls), figures["open_ends_m"]) == (len(CORNERS), [])
    assert abs(figures["threshold_higher_db"] - 8.0) < 1.96 * figures["threshold_sd_db"] < 4.0
    assert "0 ± 4.0 dB was expected (its threshold_sd_db)" in room_file.read_text(encoding="utf-8")


@pytest.mark.soak
def test_a_room_with_corners_to_both_sides_is_found_from_all_echoes() -> None:
    arena, board = load_room("arena"), load_board("polaroid-6500")
    scans = [predicted_scan(arena, arena.places[f"p{k}"], board, every=True) for k in range(5)]
    found = find_room(scans, board, arena.air)
    # a search by the first echoes alone ends with seven walls, which explain 74 %, one by all alone with six right ones
    assert found.explained > 0.9 * found.echoes
    assert len(found.draft.walls) == 8
