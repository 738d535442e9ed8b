"""How often predicted first echoes are measured: `python -m benchmarks.real.heard_paths [FOLDER]`, under a minute.

Each scan is compared at the pose with the most matches, with the profile of its sensor in `examples`, or the generic
one without such. Counts the headings whose predicted first echo is measured within 5 cm, of those where it is measured
or where silence or a farther echo is; a nearer echo hides it. The counts are by level over the threshold, by number of
reflections of the path, by range and by angle off the axis, then by sensor for faint far echoes.
"""

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from sonarhw_compare.match import Comparison, Kind, Matched
from sonarhw_sim.air import Model
from sonarhw_sim.board.profile import Board, load_board

from benchmarks.real.judged_scans import judge, load_sensors, program_options

LEVELS = (0.0, 3.0, 6.0, 9.0, math.inf)  # dB over the threshold
FAR = 1.2  # m
AXIS_STEP = 20  # degrees off the axis
COUNTED = {Kind.MATCH: True, Kind.MISSED: False, Kind.LONG: False}


@dataclass(frozen=True)
class FirstEcho:
    """A predicted first echo, and whether it is measured."""

    sensor: str
    heard: bool
    over_threshold: float  # dB
    reflections: int
    range: float  # m
    off_axis_deg: float


def profile_of(sensor: str) -> Board:
    """Return the profile of a sensor in `examples`, or the generic one."""
    file = Path(f"examples/lego_nxt_{sensor.lower()}.toml")
    return load_board(file if file.is_file() else "lego-nxt")


def first_echoes(sensor: str, comparison: Comparison) -> Iterator[FirstEcho]:
    """Yield the predicted first echoes of one scan that the readings confirm or contradict."""
    for row in comparison.rows:
        if row.kind in COUNTED and row.predicted is not None:
            yield _first_echo(sensor, comparison, row, row.predicted)


def _first_echo(sensor: str, comparison: Comparison, row: Matched, range_: float) -> FirstEcho:
    prediction = comparison.prediction
    path = int(prediction.winners[row.index])
    axis = np.array([math.cos(row.heading), math.sin(row.heading)])
    cosine = float(np.clip(prediction.paths.leaving[path] @ axis, -1.0, 1.0))
    level = prediction.ping(row.index).level_of_reading - prediction.board.threshold_db
    reflections = int(prediction.paths.bounces[path])
    return FirstEcho(sensor, COUNTED[row.kind], level, reflections, range_, math.degrees(math.acos(cosine)))


def _print_rates(title: str, echoes: Sequence[FirstEcho], key: Callable[[FirstEcho], str]) -> None:
    groups = defaultdict(list)
    for echo in echoes:
        groups[key(echo)].append(echo.heard)
    print(f"{title}: " + "; ".join(f"{name}: {np.mean(of):.2f} of {len(of)}" for name, of in sorted(groups.items())))


def _reflections(echo: FirstEcho) -> str:
    return f"{echo.reflections} reflection{'s' * (echo.reflections != 1)}"


def _far(echo: FirstEcho) -> str:
    return f"{'from' if echo.range >= FAR else 'below'} {FAR} m"


def _off_axis(echo: FirstEcho) -> str:
    return f"from {AXIS_STEP * int(echo.off_axis_deg // AXIS_STEP)}° off the axis"


def _print_levels(echoes: Sequence[FirstEcho]) -> None:
    for low, high in pairwise(LEVELS):
        some = [echo for echo in echoes if low <= echo.over_threshold < high]
        _print_rates(f"{low:g} to {high:g} dB", some, _reflections)
        for key in (_far, _off_axis):
            single = [echo for echo in some if echo.reflections == 1]
            _print_rates(f"{low:g} to {high:g} dB, 1 reflection", single, key)


def main() -> None:
    """Print how often predicted first echoes are measured."""
    folder = program_options("Count how often predicted first echoes are measured in real scans.").folder
    echoes: list[FirstEcho] = []
    for sensor, scans in load_sensors(folder).items():
        board = profile_of(sensor)
        for scan in scans:
            echoes += first_echoes(sensor, judge(scan, Model.RAY_FOLLOWING, board))
    print("share of predicted first echoes that are measured")
    _print_levels(echoes)
    faint = [echo for echo in echoes if echo.range >= FAR and echo.over_threshold < LEVELS[1]]
    for sensor in dict.fromkeys(echo.sensor for echo in faint):
        title = f"sensor {sensor}, below {LEVELS[1]:g} dB, from {FAR} m"
        _print_rates(title, [echo for echo in faint if echo.sensor == sensor], _reflections)


if __name__ == "__main__":
    main()
