"""Speed of traces and of the board's own receiver: `python -m benchmarks.traces`.

Prints the time of a trace of 62 ms at 1 MHz with 100 echoes on one core, of its parts, and of the detection of echoes
in it. Each time is also printed as a ratio to a plain NumPy sum of the same echoes in the same run.
"""

import math
import platform
import statistics
import time
from collections.abc import Callable

import numpy as np
from scipy.signal import fftconvolve
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.board.receiver import echo_times
from sonarhw_sim.board.traces import Arrivals, received
from sonarhw_sim.board.transducer import impulse_response

from sonarhw.readings import FloatArray

SPEED = 343.987  # m/s
LISTEN, RATE, ECHOES = 0.062, 1e6, 100
_ROUNDS, _SLOW_ROUNDS = 200, 5


def arrivals() -> Arrivals:
    """Return a hundred echoes all over the trace, 5 to 30° off the axis."""
    random = np.random.default_rng(1)
    angles = np.radians(random.uniform(5, 30, (2, ECHOES)))
    return Arrivals(
        random.uniform(0.001, 0.06, ECHOES), random.uniform(-0.1, 0.1, ECHOES), np.cos(angles[0]), np.cos(angles[1])
    )


def plain_sum(echoes: Arrivals, board: Board) -> FloatArray:
    """Return the sum in time: every echo is a burst with its carrier, convolved with h_R twice, (62 000,)."""
    signal = np.zeros(math.ceil(LISTEN * RATE) + 2000)
    rise = board.rise_cycles / board.frequency
    t = np.arange(700) / RATE
    for row in range(len(echoes)):
        late = t - echoes.times[row] % (1 / RATE)
        risen = [1 - (1 + x / rise) * np.exp(-x / rise) for x in (np.maximum(late, 0), _after(late, board))]
        pulse = echoes.amplitudes[row] * (risen[0] - risen[1]) * np.cos(math.tau * board.frequency * late)
        for cosine in (echoes.leaving[row], echoes.arriving[row]):
            angle = math.acos(cosine)
            half = math.ceil(board.aperture_radius * math.sin(angle) / SPEED * RATE)
            response = impulse_response(np.arange(-half, half + 1) / RATE, angle, board.aperture_radius, SPEED)
            pulse = fftconvolve(pulse, response / RATE)
        first = math.floor(echoes.times[row] * RATE) - (len(pulse) - len(t)) // 2
        signal[first : first + len(pulse)] += pulse
    return signal[: math.ceil(LISTEN * RATE)]


def _after(late: FloatArray, board: Board) -> FloatArray:
    return np.maximum(late - board.transmit_cycles / board.frequency, 0)


def seconds(work: Callable[[], object], rounds: int) -> float:
    """Return the median time of `rounds` runs after one that compiles, s."""
    work()
    taken = []
    for _ in range(rounds):
        began = time.perf_counter()
        work()
        taken.append(time.perf_counter() - began)
    return statistics.median(taken)


def main() -> None:
    """Print the table."""
    board, echoes = load_board("polaroid-6500"), arrivals()
    signal = received(echoes, board, SPEED, LISTEN)
    plain = seconds(lambda: plain_sum(echoes, board), _SLOW_ROUNDS)
    print(f"{platform.machine()}, Python {platform.python_version()}, NumPy {np.__version__}")
    print(f"{ECHOES} echoes, {LISTEN * 1e3:.0f} ms at {RATE / 1e6:.0f} MHz{'':12}time   of the plain sum")
    for what, work in (
        ("trace with its carrier", lambda: received(echoes, board, SPEED, LISTEN).rf(RATE)),
        ("  of it: echoes summed", lambda: received(echoes, board, SPEED, LISTEN)),
        ("  of it: carrier added", lambda: signal.rf(RATE)),
        ("envelope at 50 kHz", lambda: received(echoes, board, SPEED, LISTEN).envelope()),
        ("echoes detected in it", lambda: echo_times(signal.samples, board, SPEED)),
    ):
        taken = seconds(work, _ROUNDS)
        print(f"{what:36}{taken * 1e3:6.3f} ms {taken / plain:12.4f}")
    print(f"{'plain sum':36}{plain * 1e3:6.1f} ms")


if __name__ == "__main__":
    main()
