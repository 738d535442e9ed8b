"""Run fuzzed inputs: `python -m tests.soak.fuzz FIRST COUNT [COMMAND...]`. Prints each fault with its number."""

import gc
import importlib
import os
import pkgutil
import shutil
import sys
import tempfile
from collections import defaultdict
from contextlib import redirect_stdout
from pathlib import Path

import sonarhw_cli
import sonarhw_compare
import sonarhw_gui
import sonarhw_sim
from sonarhw_cli.app import run

import sonarhw
from tests.soak.fuzz import fuzzed_plugin
from tests.soak.fuzz.command_lines import BOARD, ROOM, Generator
from tests.soak.fuzz.forked_run import faults_of

_IN_MEMORY = Path("/dev/shm")  # the commands sync every file to the disk


def _load_everything(folder: Path) -> None:
    """Import and compile what the commands need, so that no case spends its time with it."""
    for package in (sonarhw, sonarhw_sim, sonarhw_compare, sonarhw_cli, sonarhw_gui):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not module.name.endswith("__main__"):
                importlib.import_module(module.name)
    room, log = folder / "room.toml", folder / "log.mcap"
    room.write_text(ROOM)
    board = folder / "board.toml"
    board.write_text(BOARD)
    with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere):
        run(["simulate", str(room), "--step", "90", "--board", str(board), "--traces", "envelope", "--out", str(log)])
        run(["compare", str(log), "--plot", str(folder / "plot.png")])
        run(["report", str(log), "--receiver", "board", "--out", str(folder / "report.html")])
    # collection in a child would copy the memory that it shares
    gc.collect()
    gc.freeze()


def main() -> int:
    """Run the inputs with these numbers; return 1 if one of them has a fault."""
    first, count = map(int, sys.argv[1:3])
    os.environ |= {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", "ARROW_DEFAULT_MEMORY_POOL": "system"}
    os.environ.pop("DISPLAY", None)
    os.environ.pop("WAYLAND_DISPLAY", None)
    folder = Path(tempfile.mkdtemp(prefix="fuzz-", dir=_IN_MEMORY if _IN_MEMORY.is_dir() else None))
    fuzzed_plugin.install(folder / "packages")
    _load_everything(folder)
    generator, found = Generator(folder, sys.argv[3:]), 0
    times: dict[str, list[float]] = defaultdict(list)
    try:
        for number in range(first, first + count):
            case, place = generator.case(number), folder / str(number)
            place.mkdir()
            faults, ended = faults_of(case, place)
            shutil.rmtree(place)
            times[case.arguments[0]].append(ended.seconds)
            if faults:
                found += 1
                print(f"{number}: {'; '.join(faults)}\n    {case.arguments!r:.500}\n{_end_of(ended.error)}", flush=True)
    finally:
        shutil.rmtree(folder)
    print(f"{count} inputs, {found} with faults; processor time: count, mean and largest, s")
    for name, spent in sorted(times.items(), key=lambda item: -sum(item[1])):
        print(f"    {name:10} {len(spent):5} {sum(spent) / len(spent):6.2f} {max(spent):6.2f}", flush=True)
    return 1 if found else 0


def _end_of(error: str) -> str:
    lines = error.splitlines()
    return "\n".join(f"    {line:.300}" for line in lines[-7:])


if __name__ == "__main__":
    sys.exit(main())
