"""Modules loaded and kernels compiled before the first use, each case in its own process."""

import subprocess
import sys
from pathlib import Path

from tests.checkout import CHECKOUT

ONE_WALL = """
name = "One wall"
materials.board.reflectance = 0.9
walls = [{ name = "wall", points = [[-9.0, 0.0], [9.0, 0.0]], material = "board" }]
"""
SMALL_THINGS = """
name = "A hook, a wire and a leg of a chair before a wall"
materials.board = { reflectance = 0.8, scatter = 0.1 }
walls = [
    { name = "wall", points = [[-5.0, 2.0], [5.0, 2.0]], material = "board" },
    { name = "hook", points = [[0.5, 1.0], [0.53, 1.0], [0.53, 1.04]], material = "board" },
]
posts = [
    { name = "wire", center = [-0.2, 1.5], radius = 0.002, material = "board" },
    { name = "leg", center = [0.2, 1.2], radius = 0.02, material = "board" },
]
"""


def test_all_kernels_are_compiled_after_prepare() -> None:
    program = """
import math, sys
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room
from sonarhw_sim.predict.room_echoes import RoomEchoes
from sonarhw_sim.compiled import Kernel
from sonarhw.readings import Ping

def compiled():
    ours = [module for name, module in sys.modules.items() if name.startswith("sonarhw_sim.")]
    return {key: len(kernel.dispatcher.signatures) for module in ours for key, kernel in vars(module).items()
            if isinstance(kernel, Kernel)}

room = load_room("rooms/simple.toml")
source = RoomEchoes(room, room.places["figure9"], load_board("paper"))
source.prepare()
before = compiled()
source.receive(Ping(1.0, 0, 0, 0.06, trace=True))
assert before and compiled() == before, (before, compiled())
"""
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


def test_no_command_uses_a_kernel_that_make_setup_does_not_compile(tmp_path: Path) -> None:
    program = """
import contextlib, io, runpy, sys
from sonarhw_sim.compiled import Kernel

def compiled():
    ours = [(name, module) for name, module in sys.modules.items() if name.startswith("sonarhw")]
    return {(name, key, str(types)) for name, module in ours for key, kernel in vars(module).items()
            if isinstance(kernel, Kernel) and kernel.__module__ == name for types in kernel.dispatcher.overloads}

runpy.run_path("setup/compile_kernels.py")["compile_kernels"]()
before = compiled()
from sonarhw_cli.app import run
simple, log, traces, one_wall, small = ["rooms/simple.toml", "--place", "figure7"], *sys.argv[1:]
for command in (
    ["simulate", *simple, "--step", "30", "--out", log],
    ["simulate", *simple, "--receiver", "board", "--traces", "sampled", "--step", "90", "--out", traces],
    ["simulate", "laboratory", "--place", "bench", "--edge-strength", "keller"],
    ["simulate", "doorstep", "--place", "tripod", "--board", "hc-sr04", "--unit", "block"],
    ["simulate", "arena", "--place", "p1", "--board", "lego-nxt", "--step", "30"],
    ["simulate", one_wall, "--place", "0,1", "--board", "hc-sr04", "--step", "30"],  # a search that finds one path
    ["simulate", "table_top", "--place", "table", "--step", "30"],
    ["simulate", small, "--place", "0,0", "--step", "30"],
    ["simulate", small, "--place", "0,0", "--step", "30", "--board", "hc-sr04", "--receiver", "board"],
    ["paths", *simple],
    ["fit", log, "--free", "position", "--samples", "0"],
    ["--quiet", "map", log],
):
    with contextlib.redirect_stdout(io.StringIO()):
        assert run(command) == 0, command
    assert before and compiled() == before, (command, compiled() - before)
"""
    files = [str(tmp_path / name) for name in ("scan.mcap", "traces.npz", "one_wall.toml", "small_things.toml")]
    Path(files[2]).write_text(ONE_WALL)
    Path(files[3]).write_text(SMALL_THINGS)
    assert subprocess.run([sys.executable, "-c", program, *files], cwd=CHECKOUT, check=False).returncode == 0


def test_choices_load_neither_numpy_nor_pydantic() -> None:
    program = "import sys, sonarhw_sim.air; print({'numpy', 'pydantic'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
