"""Scans of a wall by a fake scanner with a board whose constants the test hides."""

import math

import numpy as np
from sonarhw_compare.calibration.plate_readings import PlateReadings, plate_readings
from sonarhw_sim.board.profile import Board, load_board, parse_board
from sonarhw_sim.predict.room_echoes import Disturbance, RoomEchoes
from sonarhw_sim.room.room import Place, Room, parse_room

from sonarhw.readings import Ping, Reading, Trace
from sonarhw.sound_speed import speed_of_sound

DISTANCES = (0.25, 0.5, 1.0, 2.0, 3.0)  # m; the first is so near that blanking hides the begin of the echo
LISTEN = 0.025  # s
ALONE = Disturbance(furniture=False)
WALL = """
name = "Wall"
[materials.steel]
reflectance = 1.0
[[walls]]
name = "wall"
points = [[0.0, -6.0], [0.0, 6.0]]
material = "steel"
"""
STARTS_EARLY = 0.0008  # s, blanking of the profile with which the scans are made
CONSTANTS = {
    "aperture_radius": 0.0178,
    "gain_step_db": 3.3,
    "threshold_db": -36.5,
    "rise_cycles": 2.3,
    "own_burst_db": 9.0,
    "blanking": 0.0017,
}


def start_board() -> Board:
    """Return the profile with which the calibration begins: the shipped one with less blanking."""
    text = load_board("polaroid-6500").text
    return parse_board(text.replace("blanking = 0.00238 ", f"blanking = {STARTS_EARLY} "), "start")


def hidden_board(**constants: float) -> Board:
    """Return the board of the scanner, with these constants in place of `CONSTANTS`."""
    return start_board().with_numbers(CONSTANTS | constants)


def wall_room() -> Room:
    """Return a long smooth wall along the y axis, and nothing else, with a place for each distance."""
    places = "".join(f'[places."{one:g}"]\nposition = [{-one}, 0.0]\n' for one in DISTANCES)
    return parse_room(WALL + places, "wall")


def scanned_plate(
    board: Board,
    distance: float,
    seed: int = 0,
    traces: bool = True,
    step_deg: float = 1.0,
    pings: int = 3,
    tilt_deg: float = 0.0,
    disturbance: Disturbance = ALONE,
) -> list[Reading]:
    """Return the readings of a fake scanner, `distance` m from a wall at turntable angle -`tilt_deg`."""
    place = Place("here", (-distance, 0.0), math.radians(tilt_deg))
    echoes = RoomEchoes(wall_room(), place, board, seed, disturbance)
    readings: list[Reading] = []
    for degrees in np.arange(-40.0, 40.0 + 1e-9, step_deg).tolist():
        for index in range(pings):
            result = echoes.receive(Ping(math.radians(degrees), 0, index, LISTEN, traces))
            times = tuple(time for time in result.echo_times if time >= STARTS_EARLY)
            temperature = echoes.temperature_c
            assert temperature is not None
            readings.append(
                Reading(
                    len(readings),
                    0,
                    index,
                    math.radians(degrees),
                    0.1 * len(readings),
                    times,
                    speed_of_sound(temperature),
                    temperature,
                    result.trace and _in_8_bits(result.trace),
                )
            )
    return readings


def plates(
    board: Board,
    distances: tuple[float, ...] = DISTANCES,
    seed: int = 0,
    tilt_deg: float = 0.0,
    traces: bool = True,
    step_deg: float = 1.0,
) -> list[PlateReadings]:
    """Return what scans at all distances contain about the plate."""
    return [
        plate_readings(
            f"{distance:g} m",
            scanned_plate(board, distance, 10 * seed + k, traces, step_deg, tilt_deg=tilt_deg),
            distance,
            0.0,
            start_board(),
            STARTS_EARLY,
        )
        for k, distance in enumerate(distances)
    ]


def _in_8_bits(trace: Trace) -> Trace:
    """Return the trace as a frame carries it."""
    return Trace(np.round(trace.samples * 255) / 255, trace.rate, trace.start, trace.carrier)
