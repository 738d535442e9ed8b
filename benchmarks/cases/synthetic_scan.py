"""Scans of a known place with known errors, for tests of fits."""

import math
from dataclasses import replace

import numpy as np
from sonarhw_sim.board.profile import Board
from sonarhw_sim.choices import Receiver
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.predict.room_echoes import Disturbance, RoomEchoes
from sonarhw_sim.room.model import Place, Room

from sonarhw.echo_source import Ping
from sonarhw.readings import FloatArray, Reading

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
    receiver: Receiver = Receiver.FIRST_ECHO,
) -> list[Reading]:
    """Return a scan of a full turn with the errors above; every reading has its first `echoes` echoes.

    Ranges are computed with a thermometer that reads `warmer` K too high. The board's own receiver reports one echo.
    """
    random = np.random.default_rng((seed, 5))
    listen = 2 * board.max_range / room.air.speed_of_sound
    speed = replace(room.air, temperature_c=room.air.temperature_c + warmer).speed_of_sound
    angles = np.arange(readings) * math.tau / readings
    if receiver is Receiver.BOARD:
        echo_times = _board_echo_times(room, place, board, angles, random)
    else:
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


def _board_echo_times(
    room: Room, place: Place, board: Board, angles: FloatArray, random: np.random.Generator
) -> list[tuple[float, ...]]:
    """Return the first echo times of the board's own receiver, with the same timing error."""
    headings = np.array([board.heading_at(float(angle), place.heading) for angle in angles])
    options = PredictionOptions(receiver=Receiver.BOARD)
    exact = 2 * predict_scan(room, place, board, headings, options).ranges / room.air.speed_of_sound
    return [() if math.isnan(time) else (float(time + random.normal(0, TIMING)),) for time in exact]
