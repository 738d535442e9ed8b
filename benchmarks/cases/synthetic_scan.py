"""Scans of a known place with known errors, for tests of fits."""

import math
from dataclasses import replace

import numpy as np
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.room_echoes import Disturbance, RoomEchoes
from sonarhw_sim.room.room import Place, Room

from sonarhw.readings import Ping, Reading

READINGS = 120
TIMING = 6e-6  # s, 1 mm of range
LEVEL = 0.5  # dB
LOST = 0.02  # of pings
ANYWHERE = 0.03  # of readings: the range is random
THERMOMETER = 0.2  # K
ERRORS = Disturbance(0.0, 0.0, 0.0, TIMING, LEVEL, 0.0, furniture=False)


def synthetic_scan(
    room: Room,
    place: Place,
    board: Board,
    seed: int,
    readings: int = READINGS,
    echoes: int = 1,
    warmer: float = 0.0,
) -> list[Reading]:
    """Return a scan of a full turn with the errors above; every reading has its first `echoes` echoes.

    Ranges are computed with a thermometer that reads `warmer` K too high.
    """
    random = np.random.default_rng((seed, 5))
    listen = 2 * board.max_range / room.air.speed_of_sound
    speed = replace(room.air, temperature_c=room.air.temperature_c + warmer).speed_of_sound
    angles = np.arange(readings) * math.tau / readings
    source = RoomEchoes(room, place, board, seed, ERRORS)
    echo_times = [source.receive(Ping(float(one), 0, 0, listen, trace=False)).echo_times[:echoes] for one in angles]
    made = []
    for number, (angle, times) in enumerate(zip(angles.tolist(), echo_times, strict=True)):
        if random.random() < LOST:
            times = ()
        if random.random() < ANYWHERE:
            times = (float(random.uniform(board.blanking_end, listen)),)
        made.append(Reading(number, 0, 0, angle, 0.1 * number, times, speed))
    return made
