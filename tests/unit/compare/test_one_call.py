"""`predict`, `compare`, `fit` and `write_report` accept files, names, objects and arrays, and agree."""

import math
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sonarhw_compare.scanner_url import fake_device, read_fake_url
from sonarhw_compare.scans import GivenScan, scan_from_arrays
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room

import sonarhw
from sonarhw import Board, PredictedScan, Reading, Room
from sonarhw.device.faults import read_faults
from sonarhw.errors import InputError
from sonarhw.log.writer import write_scan
from sonarhw.wire.frames import Frame, FrameDecoder, encode_frame
from sonarhw.wire.messages import Hello, Info
from tests.checkout import CHECKOUT
from tests.fixtures.example_logs import example_reading

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
    return [Reading(k, 0, 0, at, 0.1 * k, times[k], speed) for k, at in enumerate(scan.headings.tolist())]


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


def test_readings_alone_need_a_room(readings: list[Reading]) -> None:
    for arguments, message in (
        ((), r"the scan: contains no room; give a room"),
        (("arena",), r"give a place, or X,Y in metres; its places: p0, .*`sonarhw locate` finds"),
    ):
        with pytest.raises(InputError, match=message):
            sonarhw.compare(readings, *arguments)
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
    with pytest.warns(UserWarning, match=FEW) as warned, pytest.warns(UserWarning, match=assumed):
        sonarhw.write_report(path, tmp_path / "assumed.html")
    assert [one.filename for one in warned][:1] == [__file__]
    assert "<strong>Warning:</strong> imported.mcap: only " in (tmp_path / "assumed.html").read_text(encoding="utf-8")
    sonarhw.write_report(path, tmp_path / "given.html", board="lego-nxt")


def test_a_wrong_argument_states_what_is_expected(log: Path) -> None:
    with pytest.raises(InputError, match=r"place: expected x and y in metres, and no .* got \(0.5, 0.5, 0.5, 0.5\)"):
        sonarhw.compare(log, place=(0.5, 0.5, 0.5, 0.5))
    with pytest.raises(InputError, match=r"found: expected the map of `map_scans`, .* got an object of type Log"):
        sonarhw.draw_map(sonarhw.read_log(log))  # type: ignore[arg-type]


# Scans from arrays.


HEADINGS = np.radians([0.0, 90.0, 180.0])


@pytest.mark.parametrize("change", [{"speed_of_sound": math.nan}, {"angle": math.nan}, {"echo_times": (math.inf,)}])
def test_readings_without_range_or_angle_are_refused(change: dict[str, float]) -> None:
    readings = [example_reading(number) for number in range(4)]
    assert GivenScan("scan.mcap", tuple(readings)).readings == tuple(readings)
    readings[1] = replace(readings[1], **change)
    with pytest.raises(InputError, match=r"scan\.mcap: the range or angle of reading 1 is unknown; .* log export"):
        GivenScan("scan.mcap", tuple(readings))


def test_arrays_become_readings_with_silence_pings_echoes_and_a_pose() -> None:
    scan = scan_from_arrays(HEADINGS, [1.0, np.nan, np.inf], pose=(1.0, 2.0, 0.5))
    assert [reading.range for reading in scan.readings] == pytest.approx([1.0, None, None])
    assert [reading.angle for reading in scan.readings] == HEADINGS.tolist()
    assert (scan.pose.position, scan.pose.heading) == ((1.0, 2.0), 0.5)
    ranges = np.array([[[1.0, 2.0], [1.1, np.nan]], [[3.0, 4.0], [np.nan, np.nan]]])
    several = scan_from_arrays([0, 90], ranges, degrees=True, pose=[0, 0, 90], times=[5.0, 6.0])
    assert [reading.echo_ranges for reading in several.readings] == [
        pytest.approx(echoes) for echoes in ((1.0, 2.0), (1.1,), (3.0, 4.0), ())
    ]
    assert [(reading.angle, reading.ping, reading.time) for reading in several.readings] == [
        (0.0, 0, 5.0),
        (0.0, 1, 5.0),
        (math.pi / 2, 0, 6.0),
        (math.pi / 2, 1, 6.0),
    ]
    assert several.pose.heading == math.pi / 2
    masked = np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False])
    assert [reading.range is None for reading in scan_from_arrays(HEADINGS, masked).readings] == [False, True, False]
    assert pickle.loads(pickle.dumps(scan)) == scan


@pytest.mark.parametrize(
    ("headings", "ranges", "warning"),
    [
        (np.arange(0, 360, 5), np.ones(72), "headings: up to 355, taken as radians; if they are degrees"),
        (HEADINGS, [120.0, 340.0, 95.0], "ranges: half of them over 30 m; if they are centimetres"),
    ],
)
def test_probable_degrees_and_centimetres_are_warned_of(headings: object, ranges: object, warning: str) -> None:
    with pytest.warns(UserWarning, match=warning):
        scan_from_arrays(headings, ranges)


# The fake scanner of a `fake:` URL.


@pytest.mark.parametrize(("faults", "minor"), [("", 2), ("drift=200", 2), ("protocol=1.9", 9)])
def test_a_new_fake_scanner_reports_its_first_start_seed_and_profile(faults: str, minor: int) -> None:
    room = load_room("rooms/simple.toml")
    device, _ = fake_device(room, room.places["figure9"], load_board("lego-nxt"), 42, read_faults(faults))
    device.receive(encode_frame(Frame(Hello.TYPE, 1, 0, Hello(1, 1).pack())), 0.0)
    (frame, *_) = FrameDecoder().feed(device.advance(0.1))
    info = Info.unpack(frame.payload)
    assert (info.boot, info.serial, info.board) == (1, "FAKE-0042", "lego-nxt")
    assert (info.major, info.minor, info.homed) == (1, minor, 0)


def test_a_heading_that_is_no_number_is_refused() -> None:
    for text in ("north", "nan", "inf", ""):
        with pytest.raises(InputError, match=f"heading '{text}': expected degrees"):
            read_fake_url(f"fake:laboratory?place=door&heading={text}")
