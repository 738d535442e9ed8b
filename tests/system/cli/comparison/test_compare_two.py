"""`sonarhw compare --with`: a post that was added to a room is found by heading, without a room."""

import csv
import json
from pathlib import Path
from statistics import median

import pytest
from sonarhw_cli.app import run

POST = '[[posts]]\nname = "chair"\ncenter = [0.3, 0.4]\nradius = 0.03\nmaterial = "shelving"\n'


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    folder = tmp_path_factory.mktemp("logs")
    (folder / "with_post.toml").write_text(Path("rooms/simple.toml").read_text() + POST)
    for room, out in (("rooms/simple.toml", "before"), (str(folder / "with_post.toml"), "after")):
        assert run(["simulate", room, "--place", "figure9", "--step", "5", "--out", str(folder / f"{out}.mcap")]) == 0
    return str(folder / "before.mcap"), str(folder / "after.mcap")


def test_a_post_is_nearer_than_what_was_behind_it(
    logs: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before, after = logs
    table, picture = tmp_path / "differences.csv", tmp_path / "differences.png"
    capsys.readouterr()
    assert run(["compare", before, "--with", after, "--csv", str(table), "--plot", str(picture)]) == 0
    printed = capsys.readouterr().out
    # the nearest point of the post is at 0.54 m and 146°
    rows = list(csv.DictReader(table.read_text().splitlines()))
    changed = [row for row in rows if 140 <= float(row["heading_deg"]) <= 165]
    first, second = (sorted(float(row[which]) for row in changed) for which in ("first_m", "second_m"))
    by = median(abs(float(row["difference_m"])) for row in changed)
    assert (
        f"140.0° to 165.0°: 6 headings nearer by {100 * by:.1f} cm (median): "
        f"first {first[0]:.3f} to {first[-1]:.3f} m, second {second[0]:.3f} to {second[-1]:.3f} m\n"
    ) in printed
    (at_post,) = [row for row in rows if row["heading_deg"] == "145"]
    assert (at_post["change"], float(at_post["second_m"])) == ("nearer", pytest.approx(0.54, abs=0.02))
    assert float(at_post["difference_m"]) == pytest.approx(float(at_post["second_m"]) - float(at_post["first_m"]))
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_scan_is_the_same_as_itself(logs: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert run(["compare", logs[0], "--sweep", "1", "--with-sweep", "1", "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert (figures["headings"], figures["changes"]["same"], figures["stretches"]) == (72, 72, [])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--with", "{after}", "--room", "simple"], "--room: not used with --with"),
        (["--with", "{after}", "--model", "nearest"], "--model: not used with --with"),
        (["--with", "{after}", "--room-tolerance", "0"], "--room-tolerance: not used with --with"),
        (["--with", "{after}", "--out", "room.toml"], "--out: not used with --with"),
        (["--csv", "-"], "--csv: needs --with"),
        (["--with-sweep", "1"], "--with-sweep: without --with, give the other sweep"),
        (["--with", "{after}", "--with-sweep", "2"], "has no sweep 2; its sweeps: 1 to 1"),
    ],
)
def test_what_does_not_go_together_is_refused(
    logs: tuple[str, str], options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    assert run(["compare", logs[0], *(option.format(after=logs[1]) for option in options)]) == 2
    assert message in capsys.readouterr().err


def test_logs_of_different_rooms_give_a_warning_with_their_names(
    logs: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    corner = str(tmp_path / "corner.mcap")
    assert run(["simulate", "rooms/right_corner.toml", "--place", "figure12", "--step", "5", "--out", corner]) == 0
    capsys.readouterr()
    assert run(["compare", logs[0], "--with", corner]) == 0
    assert "the logs contain different rooms, 'Simple room' and 'Right-angle corner'" in capsys.readouterr().err
    assert run(["compare", logs[0], "--with", logs[1]]) == 0
    assert "room" not in capsys.readouterr().err
