"""Modules loaded and kernels compiled before the first use, each case in its own process."""

import subprocess
import sys


def test_all_kernels_are_compiled_after_prepare() -> None:
    program = """
import math, sys
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.model import load_room
from sonarhw_sim.predict.room_echoes import RoomEchoes
from sonarhw.echo_source import Ping

def compiled():
    ours = [module for name, module in sys.modules.items() if name.startswith("sonarhw_sim.")]
    return {key: len(kernel.signatures) for module in ours for key, kernel in vars(module).items()
            if hasattr(kernel, "signatures")}

room = load_room("rooms/simple.toml")
source = RoomEchoes(room, room.places["figure9"], load_board("paper"))
source.prepare()
before = compiled()
source.receive(Ping(1.0, 0, 0, 0.06, trace=True))
assert before and compiled() == before, (before, compiled())
"""
    subprocess.run([sys.executable, "-c", program], check=True)


def test_choices_load_neither_numpy_nor_pydantic() -> None:
    program = "import sys, sonarhw_sim.choices; print({'numpy', 'pydantic'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
