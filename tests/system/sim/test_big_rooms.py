"""Rooms with very many walls: memory of a whole process that loads the room and predicts a scan.

With `--soak`, the rooms have six times as many walls, or ten times as many if they are apart. Memory that grows with
the square of the number of walls is above the limits at both sizes.
"""

import subprocess
import sys

import pytest

from tests.conftest import Count
from tests.hang_guard import HANG

PREDICT = """
import resource, sys
from pathlib import Path
import numpy as np
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import parse_room

resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))
random, count = np.random.default_rng(0), int(sys.argv[2])
start = np.zeros((count, 2))
match sys.argv[1]:
    case "apart":
        start = random.uniform(0, count**0.5, (count, 2))
        end = start + random.uniform(-0.5, 0.5, (count, 2))
    case "star":
        angles = np.arange(count) / count * 2 * np.pi
        end = 5 * np.column_stack((np.cos(angles), np.sin(angles)))
    case "nearly one point":
        angles = np.arange(count) / count * 2 * np.pi
        start = random.uniform(-4e-7, 4e-7, (count, 2))
        end = 5 * np.column_stack((np.cos(angles), np.sin(angles)))
    case "same":
        end = np.ones((count, 2))
walls = [f'[[walls]]\\nname="w{k}"\\nmaterial="m"\\npoints=[{a}, {b}]\\n'
         for k, (a, b) in enumerate(zip(start.tolist(), end.tolist()))]
head = 'name="big"\\n[materials.m]\\nreflectance=0.9\\n[places.p]\\nposition=[0.31, 0.17]\\n'
room = parse_room(head + "".join(walls), "big")
headings = np.radians(np.arange(0, 360, 30.0))
assert len(predict_scan(room, room.place("p"), load_board("paper"), headings).distances) == len(headings)
# ru_maxrss would include the memory of the process that started this one
print(int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]) // 1024)
"""


@pytest.fixture(scope="module", autouse=True)
def compiled() -> None:
    """Compile the kernels first: compilation takes more memory than these rooms."""
    subprocess.run([sys.executable, "-c", PREDICT, "same", "1"], stdout=subprocess.DEVNULL, check=True, timeout=HANG)


@pytest.mark.parametrize(
    ("walls", "normal", "full"),
    [
        ("apart", (10_000, 250), (100_000, 1000)),
        ("star", (3_500, 230), (20_000, 500)),
        ("nearly one point", (3_500, 230), (20_000, 500)),
        ("same", (3_500, 230), (20_000, 500)),
    ],
)
def test_memory_of_a_large_room(walls: str, normal: tuple[int, int], full: tuple[int, int], count: Count) -> None:
    number, most = (count(*pair) for pair in zip(normal, full, strict=True))
    done = subprocess.run(
        [sys.executable, "-c", PREDICT, walls, str(number)], capture_output=True, text=True, check=False, timeout=HANG
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) < most  # MB
