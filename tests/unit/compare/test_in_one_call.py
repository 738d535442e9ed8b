"""`predict`, `compare`, `fit`, `locate` and `write_report` accept files, names and objects, and agree."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sonarhw
from sonarhw import Board, Log, PredictedScan, Reading, Room
from sonarhw.errors import InputError
from sonarhw.log.writer import write_scan
from tests.checkout import CHECKOUT

ARENA = CHECKOUT / "rooms" / "arena.toml"
FEW = r"(scan|imported)\.mcap: only \d+% of \d+ echoes are within 5 cm of the prediction; check the room, the place"
METADATA = sonarhw.LogMetadata("scan", 1.0, "arena.toml", ARENA.read_text(encoding="utf-8"), "p3", "lego-nxt")


@pytest.fixture(scope="module")
def room() -> Room:
    return sonarhw.load_room(ARENA)


@pytest.fixture(scope="module")
def board() -> Board:
    return sonarhw.load_board("lego-nxt")


def readings_of(scan: PredictedScan) -> list[Reading]:
    """Return the readings of a scanner with step 0 along +x that measures what is predicted, 7 mm too long."""
    speed = scan.room.air.speed_of_sound
    times = [() if math.isnan(one) else (2 * (one + 0.007) / speed,) for one in scan.ranges.tolist()]
    return [
        Reading(k, 0, 0, float(heading), 0.1 * k, times[k], speed) for k, heading in enumerate(scan.headings.tolist())
    ]


@pytest.fixture(scope="module")
def readings(room: Room, board: Board) -> list[Reading]:
    fine = replace(board, rounding=0.0)
    return readings_of(sonarhw.predict(room, "p3", fine))


@pytest.fixture(scope="module")
def log(readings: list[Reading], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("logs") / "scan.mcap"
    write_scan(path, METADATA, readings)
    return path


def test_predict_accepts_names_files_and_objects(room: Room, board: Board) -> None:
    scan = sonarhw.predict("arena", "p3", "lego-nxt")
    others = [
        sonarhw.predict(ARENA, (1.38, 0.54), board),
        sonarhw.predict(str(ARENA), "1.38,0.54", "lego-nxt", np.radians(np.arange(0, 360, 5))),
        sonarhw.predict(room, room.place("p3"), board, [math.radians(k) for k in range(0, 360, 5)]),
    ]
    assert len(scan.ranges) == 72
    assert np.isfinite(scan.ranges).sum() > 36
    for other in others:
        assert np.array_equal(other.ranges, scan.ranges, equal_nan=True)
    assert sonarhw.predict(room, "p3", board, 0.0).ranges[0] == scan.ranges[0]


def test_compare_takes_room_place_and_board_from_the_log(log: Path, readings: list[Reading], room: Room) -> None:
    comparison = sonarhw.compare(log)
    assert comparison.prediction.board.name == "lego-nxt"
    assert comparison.prediction.place.position == room.place("p3").position
    assert comparison.summary().within_5cm == 1.0
    for same in (
        sonarhw.compare(str(log)),
        sonarhw.compare(sonarhw.read_log(log)),
        sonarhw.compare(readings, "arena", "p3", "lego-nxt"),
    ):
        assert [row.kind for row in same.rows] == [row.kind for row in comparison.rows]


def test_compare_prefers_what_is_given_and_fits_first(log: Path) -> None:
    with pytest.warns(UserWarning, match=FEW):
        assert sonarhw.compare(log, place=(1.0, 1.0)).prediction.place.position == (1.0, 1.0)
    with pytest.warns(UserWarning, match=FEW):
        assert sonarhw.compare(log, board="paper").prediction.board.name == "paper"
    fitted = sonarhw.compare(log, fit="offset")
    assert fitted.offset == pytest.approx(-0.007, abs=0.003)
    assert sonarhw.compare(log, fit=["offset"]).offset == fitted.offset


def test_fit_finds_offset_and_position(log: Path, readings: list[Reading]) -> None:
    result = sonarhw.fit(log, free="position,offset", samples=0)
    assert result.estimates["x"].value == pytest.approx(1.38, abs=0.005)
    assert result.estimates["offset"].value == pytest.approx(-0.007, abs=0.002)
    near = sonarhw.fit(readings, "arena", "p3", "lego-nxt", free=["offset"], priors=["offset=0..1"], samples=0)
    assert near.estimates["offset"].value == pytest.approx(0.0, abs=5e-5)  # at the bound


def test_fit_of_two_scans_gives_each_its_own_place(log: Path, readings: list[Reading]) -> None:
    result = sonarhw.fit([log, readings], places=["p3", (1.40, 0.55)], board="lego-nxt", free="x", samples=0)
    assert result.estimates["x@scan"].value == pytest.approx(1.38, abs=0.01)
    assert len(result.places) == 2


def test_locate_finds_the_place(log: Path) -> None:
    located = sonarhw.locate(log)
    assert located.places()["p3"] == pytest.approx(1.0, abs=0.01)


def test_readings_alone_need_a_room(readings: list[Reading]) -> None:
    with pytest.raises(InputError, match=r"the scan: contains no room; give a room"):
        sonarhw.compare(readings)
    with pytest.raises(InputError, match=r"the scan: contains no readings"):
        sonarhw.compare([], "arena", "p3")


def test_a_torn_log_gives_a_warning(log: Path, tmp_path: Path) -> None:
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(log.read_bytes()[:-2000])
    with pytest.warns(UserWarning, match=r"torn\.mcap: torn; \d+ whole readings read") as warned:
        sonarhw.compare(torn)
    assert warned[0].filename == __file__


def test_a_log_that_names_no_board_gives_a_warning(readings: list[Reading], tmp_path: Path) -> None:
    path = tmp_path / "imported.mcap"
    write_scan(path, replace(METADATA, board=""), readings)
    assumed = r"imported\.mcap: names no board, polaroid-6500 is assumed; give the right board$"
    with pytest.warns(UserWarning, match=assumed) as warned:
        sonarhw.fit(path, free="offset", samples=0)
    assert [one.filename for one in warned] == [__file__]
    # with the wrong board, few echoes are explained
    with pytest.warns(UserWarning, match=FEW), pytest.warns(UserWarning, match=assumed) as warned:
        sonarhw.compare(path)
    assert [one.filename for one in warned] == [__file__, __file__]
    assert sonarhw.compare(path, board="lego-nxt").summary().within_5cm == 1.0
    with pytest.warns(UserWarning, match=FEW), pytest.warns(UserWarning, match=assumed):
        sonarhw.write_report(path, tmp_path / "assumed.html")
    sonarhw.write_report(path, tmp_path / "given.html", board="lego-nxt")


def test_a_place_outside_the_room_gives_a_warning(log: Path, room: Room) -> None:
    outside = r"place '9,9' at 9, 9 m is outside room"
    with pytest.warns(UserWarning, match=outside) as warned:
        sonarhw.predict(room, (9.0, 9.0))
    assert [one.filename for one in warned] == [__file__]
    with pytest.warns(UserWarning, match=FEW), pytest.warns(UserWarning, match=outside) as warned:
        sonarhw.compare(log, place=(9.0, 9.0))
    assert [one.filename for one in warned] == [__file__, __file__]


def test_a_log_is_accepted_by_name(log: Path) -> None:
    assert isinstance(sonarhw.read_log(str(log)), Log)


def test_a_report_of_readings_and_one_of_their_log_show_the_same(
    log: Path, readings: list[Reading], tmp_path: Path
) -> None:
    from_log, from_readings = tmp_path / "log.html", tmp_path / "readings.html"
    sonarhw.write_report(log, from_log, fit="offset")
    sonarhw.write_report(readings, from_readings, ARENA, "p3", "lego-nxt", fit="offset")
    pages = [path.read_text(encoding="utf-8") for path in (from_log, from_readings)]
    assert all("place p3</h1>" in page and page.count("data:image/svg") == 3 for page in pages)
    summary = sonarhw.compare(log, fit="offset").summary()
    lead = f"{summary.within_5cm:.0%} of {summary.n_echo} echoes lie within 5 cm"
    assert all(lead in page for page in pages)
    with pytest.raises(InputError, match="exists already"):
        sonarhw.write_report(log, from_log)
    sonarhw.write_report(log, from_log, overwrite=True)


def test_jupyter_gets_a_figure_as_a_picture_before_pyplot_is_used() -> None:
    figure = sonarhw.draw_plan(sonarhw.predict("simple", "figure9"))
    assert figure._repr_png_().startswith(b"\x89PNG")  # type: ignore[attr-defined]


def test_a_wrong_argument_states_what_is_expected(log: Path) -> None:
    with pytest.raises(
        InputError, match=r"place: expected x and y in metres, and no heading or .* got \(0.5, 0.5, 0.5, 0.5\)"
    ):
        sonarhw.compare(log, place=(0.5, 0.5, 0.5, 0.5))
    with pytest.raises(InputError, match=r"found: expected the map of `map_scans`, .* got an object of type Log"):
        sonarhw.draw_map(sonarhw.read_log(log))  # type: ignore[arg-type]


def test_a_scan_of_an_unknown_place_names_locate(readings: list[Reading]) -> None:
    with pytest.raises(InputError, match=r"give a place, or X,Y in metres; its places: p0, .*`sonarhw locate` finds"):
        sonarhw.compare(readings, "arena")


def test_a_comparison_in_the_wrong_place_gives_a_warning(log: Path, tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match=FEW) as warned:
        sonarhw.write_report(log, tmp_path / "wrong.html", place="p0")
    assert [one.filename for one in warned] == [__file__]
    assert "<strong>Warning:</strong> scan.mcap: only " in (tmp_path / "wrong.html").read_text(encoding="utf-8")
