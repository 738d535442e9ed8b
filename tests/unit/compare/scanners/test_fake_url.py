"""The fake scanner of a `fake:` URL: what it reports about itself, with and without faults."""

from math import radians

import numpy as np
import pytest
from sonarhw_compare.scanner_url import fake_device, read_fake_url
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room

from sonarhw.device.faults import NO_FAULTS, read_faults
from sonarhw.errors import InputError
from sonarhw.readings import Ping
from sonarhw.wire.frames import Frame, FrameDecoder, encode_frame
from sonarhw.wire.messages import Hello, Info


@pytest.mark.parametrize(("faults", "minor"), [("", 2), ("drift=200", 2), ("protocol=1.9", 9)])
def test_a_new_fake_scanner_reports_its_first_start_seed_and_profile(faults: str, minor: int) -> None:
    room = load_room("rooms/simple.toml")
    device, _ = fake_device(room, room.places["figure9"], load_board("lego-nxt"), 42, read_faults(faults))
    device.receive(encode_frame(Frame(Hello.TYPE, 1, 0, Hello(1, 1).pack())), 0.0)
    (frame, *_) = FrameDecoder().feed(device.advance(0.1))
    assert isinstance(frame, Frame)
    info = Info.unpack(frame.payload)
    assert (info.boot, info.serial, info.board) == (1, "FAKE-0042", "lego-nxt")
    assert (info.major, info.minor, info.homed) == (1, minor, 0)


def test_a_fake_scanner_is_one_sensor_of_a_population() -> None:
    room, population = load_room("arena"), load_board("lego-nxt")
    _, echoes = fake_device(room, room.places["p3"], population, 1, NO_FAULTS)
    pings = [echoes.receive(Ping(0.0, 0, number, 0.02, trace=False)).echo_times for number in range(40)]
    ranges = [times[0] * room.air.speed_of_sound / 2 for times in pings if times]
    assert len(ranges) > 30
    assert np.std(ranges) < 0.3 * population.range_sd


def test_a_fake_scanner_stands_at_a_place_with_a_heading() -> None:
    room = load_room("laboratory")
    settings = read_fake_url("fake:laboratory?place=1.5,1.2&seed=7&pace=max&board=paper&heading=-30")
    place = settings.place_in(room)
    assert (place.position, place.heading) == ((1.5, 1.2), pytest.approx(radians(-30)))
    assert (settings.seed, settings.pace, settings.board) == (7, "max", "paper")
    back = read_fake_url("fake:laboratory?place=door&seed=7&pace=max&board=paper")
    assert back.place_in(room) == room.places["door"]


def test_a_heading_that_is_no_number_is_refused() -> None:
    for text in ("north", "nan", "inf", ""):
        with pytest.raises(InputError, match=f"heading '{text}': expected degrees"):
            read_fake_url(f"fake:laboratory?place=door&heading={text}")
