"""`sonarhw fit`: the table, the JSON, written files, and errors of one line."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from sonarhw_cli.app import run
from sonarhw_compare.fit.fitting import fitted_board
from sonarhw_compare.fit.parameters import Parameter
from sonarhw_compare.fit.quantities import OFFSET, THRESHOLD
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room

QUICKLY = ["--samples", "200", "--exact"]
# this board hears only loud echoes, so a fit of its scans is quick
SIMULATE = ["simulate", "rooms/arena.toml", "--board", "hc-sr04", "--step", "6"]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A predicted scan of the arena from (1.38, 0.54), its step 0 along +x."""
    out = tmp_path_factory.mktemp("fit") / "p3.mcap"
    assert run([*SIMULATE, "--place", "p3", "--out", str(out)]) == 0
    return str(out)


def test_json_contains_the_pose_its_interval_and_units(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["fit", log, "--place", "1.4,0.5", "--json", *QUICKLY]) == 0
    figures = json.loads(capsys.readouterr().out)
    results = {"estimates", "correlations", "noise", "log_likelihood", "answers", "agreement"}
    assert set(figures) == {*results, "mismatches", "warnings"}
    assert figures["agreement"][0]["within_5cm"] > 0.9
    for name, true in (("x", 1.38), ("y", 0.54)):
        estimate = figures["estimates"][name]
        assert estimate["value"] == pytest.approx(true, abs=0.002)
        assert estimate["lower"] <= estimate["value"] <= estimate["upper"]
        assert estimate["unit"] == "m"
    heading = figures["estimates"]["heading"]
    assert heading["unit"] == "°"
    assert abs((heading["value"] + 180) % 360 - 180) < 1


def test_fitted_room_and_board_are_written_and_comments_kept(tmp_path: Path) -> None:
    log = str(tmp_path / "p3.mcap")  # of a board that hears faint echoes, which show its threshold
    # to 4 m, which limits the number of paths
    near = tmp_path / "near.toml"
    near.write_text(load_board("polaroid-6500").text.replace("max_range = 10.7", "max_range = 4.0"), encoding="utf-8")
    simulated = ["simulate", "rooms/arena.toml", "--place", "p3", "--step", "10", "--board", str(near)]
    assert run([*simulated, "--out", log]) == 0
    text = Path("rooms/arena.toml").read_text(encoding="utf-8")
    room, found, board = (tmp_path / f"{name}.toml" for name in ("room", "found", "mine"))
    room.write_text("# as measured in spring\n" + text.replace("1.38, 0.54", "1.36, 0.55"), encoding="utf-8")
    free = ["--free", "position,heading,offset,threshold,reflectance,wall:north"]
    files = ["--out", str(found), "--board-out", str(board)]
    given = ["--room", str(room), "--place", "p3", "--board", str(near), "--samples", "0"]
    assert run(["fit", log, *given, *free, *files]) == 0
    header, _, rest = found.read_text(encoding="utf-8").partition("# as measured in spring\n")
    assert header.startswith("# Fitted by `sonarhw fit` on p3.mcap, beginning with room 'Arena':\n#   x 1.3")
    for line in (r"x 1\.3\d+ ± 0\.\d{5} m; before: 1\.36000", r"heading -?0\.\d{3} ± \d\.\d{3}°; before: 0\.000"):
        assert re.search(f"^#   {line}$", header, re.M)
    assert "points" in rest
    written, before = load_room(found), load_room(room)
    assert written.places["p3"].position == pytest.approx((1.38, 0.54), abs=0.003)
    assert before.places["p3"].position == (1.36, 0.55)
    assert written.places["p2"] == before.places["p2"]
    assert np.abs(written.walls - before.walls).max() < 0.005
    profile = load_board(str(board))
    first, *_ = profile.text.splitlines()
    assert first == "# Fitted by `sonarhw fit` on p3.mcap, beginning with profile 'polaroid-6500': offset, threshold."
    assert re.search(r"^threshold_db = \S+  # fitted ± \d\.\d\d; before: -40 \(", profile.text, re.M)
    assert profile.name == "mine"
    assert profile.range_offset == pytest.approx(0, abs=0.002)
    assert profile.threshold_db == pytest.approx(load_board("polaroid-6500").threshold_db, abs=3)
    # other commands accept both files
    assert run(["simulate", str(found), "--place", "p3", "--board", str(board), "--out", str(tmp_path / "a.csv")]) == 0


def test_values_that_a_scan_hardly_constrains_stay_as_they_were_in_the_files(tmp_path: Path) -> None:
    # no path of the nearest 0.6 m touches the wall of carpet
    arena = Path("rooms/arena.toml").read_text(encoding="utf-8")
    carpet = '[[walls]]\nname = "far"\nmaterial = "carpet"\npoints = [[-1.0, 0.0], [-1.0, 1.68]]\n'
    room, board, scan, found, mine = (
        str(tmp_path / name) for name in ("room.toml", "near.toml", "scan.mcap", "found.toml", "mine.toml")
    )
    Path(room).write_text(arena + carpet + "\n[materials.carpet]\nreflectance = 0.7\n", encoding="utf-8")
    profile = load_board("polaroid-6500").text
    Path(board).write_text(profile.replace("max_range = 10.7", "max_range = 0.9"), encoding="utf-8")
    here = ["--room", room, "--place", "p3", "--board", board]
    assert run(["simulate", room, *here[2:], "--step", "6", "--out", scan]) == 0
    free = ["--free", "offset,reflectance", "--out", found, "--board-out", mine]
    assert run(["fit", scan, *here, *free, "--samples", "0"]) == 0
    text = Path(found).read_text(encoding="utf-8")
    assert "#   reflectance:carpet 0.7000: kept, the scans hardly constrain it\n" in text
    assert "[materials.carpet]\nreflectance = 0.7\n" in text
    assert "fitted ±" in Path(mine).read_text(encoding="utf-8")


def test_a_fitted_profile_does_not_call_fitted_values_tuned() -> None:
    threshold, offset = Parameter(THRESHOLD), Parameter(OFFSET)
    deviations = {threshold: 0.31, offset: 0.002}
    nxt = load_board("lego-nxt")
    text = fitted_board(nxt, {threshold: -15.554, offset: -0.01}, "mine", deviations, ["north", "south"]).text
    quoted = [line for line in text.splitlines() if line.startswith("#   ")]
    own = [line for line in text.splitlines() if line not in quoted]
    assert own[0] == "# Fitted by `sonarhw fit` on north, south, beginning with profile 'lego-nxt': threshold, offset."
    assert own[1] == "# Header of profile 'lego-nxt', for its own values only:"
    assert [line.removeprefix("#   ") for line in quoted] == [
        line.removeprefix("# ") for line in nxt.text.splitlines() if line.startswith("# ")
    ]
    changed = {line.split(" = ")[0]: line for line in own if "fitted ±" in line}
    assert changed["threshold_db"].startswith("threshold_db = -15.55  # fitted ± 0.31; before: -17.5 (tuned: ")
    assert changed["range_offset"] == "range_offset = 0.01  # fitted ± 0.00200; before: 0"
    # values that were not fitted keep their tuned values
    assert "aperture_radius = 0.00375    # m, tuned" in own
