"""Ctrl-C at random times ends every command within two seconds, with whole files. `--soak` interrupts 500."""

import os
import random
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from sonarhw_cli.app import run
from sonarhw_cli.entry import INTERRUPTED

import sonarhw
from sonarhw.log import read_log
from tests.checkout import CHECKOUT
from tests.conftest import Count
from tests.hang_guard import HANG
from tests.soak.fuzz import command_lines
from tests.system.cli.test_entry import BEGUN, begun

FAKE = "fake:simple?place=figure9"
ROOM = "--room simple --place figure9"
COMMANDS = (
    "simulate simple --place figure9 --out new/scan.csv",
    "simulate simple --place figure9 --traces envelope --out new/scan.npz",
    "paths simple --place figure9 --out new/paths.csv",
    "figures new/figures",
    "demo --headless new/demo",
    f"scan {FAKE} --out new/scan.mcap --traces",
    f"scan {FAKE} --out old.mcap --force",
    f"scan {FAKE}&pace=max --out new/scan.mcap --sweeps 200 --print",
    f"serve {FAKE} --foxglove --tcp 127.0.0.1:0",
    "fake simple --place figure9 --tcp 127.0.0.1:0",
    "replay log.mcap --tcp 127.0.0.1:0",
    f"ping {FAKE}",
    f"monitor {FAKE}",
    f"info {FAKE} --watch",
    f"doctor {FAKE}",
    f"compare log.mcap {ROOM} --plot new/plot.png",
    f"report log.mcap {ROOM} --out new/report.html",
    "locate log.mcap --room simple",
    f"fit log.mcap {ROOM} --free position,heading",
    "track drive.mcap --room simple",
    "map log.mcap --pose 0.774,0.085,0 --out new/map.png",
    "study study.toml --out new/study",
    "import scan.csv --heading deg --range m --out new/scan.mcap",
    "log export log.mcap --out new/scan.csv",
    "log recover log.mcap --out new/scan.mcap",
    "log info log.mcap",
    "room check simple",
    "room list",
    "room new new/room.toml",
    "room schema",
    "room import plan.geojson --unit m --out new/room.toml",
    "profile check paper",
    "profile list",
    "profile new new/board.toml",
    "profile schema",
    f"calibrate log.mcap {ROOM} --out new/board.toml",
    f"home {FAKE}",
    f"turn {FAKE} 90",
    f"stop {FAKE}",
    f"wiring {FAKE}",
    "board",
    "ports",
    "gui log.mcap",
    f"gui {FAKE}",
)
STUDY = """name = "study"
seed = 5
draws = 40
boards = ["paper"]
[[rooms]]
file = "{}"
places = ["figure9"]
[headings]
step = 10.0
[vary.board]
aperture_radius = {{ uniform = [0.016, 0.0192] }}
"""
LATEST = 6.0  # s after the start
WITHIN = 2.0  # s
ENDS = {".csv": b"\n", ".html": b"</html>\n", ".png": b"IEND\xaeB`\x82", ".npz": b""}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Return the files that are there before each command."""
    log = tmp_path_factory.mktemp("inputs") / "log.mcap"
    assert run(["simulate", "simple", "--place", "figure9", "--out", str(log)]) == 0
    drive = log.with_name("drive.mcap")
    poses = [(0.77 + 0.01 * (step // 8), 0.08, 0.0) for step in range(72)]
    scan = sonarhw.scan_from_arrays(np.arange(72) % 8, 1 + 0.01 * np.arange(72), pose=poses, times=np.arange(72) // 8)
    sonarhw.save_scan(scan, drive)
    return {
        "log.mcap": log.read_bytes(),
        "old.mcap": log.read_bytes(),
        "drive.mcap": drive.read_bytes(),
        "scan.csv": b"deg,m\n" + b"".join(b"%d,1\n" % angle for angle in range(0, 360, 5)),
        "plan.geojson": b'{"type": "Polygon", "coordinates": [[[0, 0], [3, 0], [3, 2], [0, 2], [0, 0]]]}',
        "study.toml": STUDY.format(CHECKOUT / "rooms" / "simple.toml").encode(),
    }


def test_every_command_is_interrupted() -> None:
    named = {name for name in command_lines.COMMANDS if any(f"{line} ".startswith(f"{name} ") for line in COMMANDS)}
    assert command_lines.COMMANDS.keys() - named == {"flash"}  # it writes to a board


@pytest.mark.timeout(20_000)
def test_ctrl_c_at_any_time_leaves_whole_files(inputs: dict[str, bytes], tmp_path: Path, count: Count) -> None:
    path = os.pathsep.join([str(CHECKOUT), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "PYTHONPATH": path, "QT_QPA_PLATFORM": "offscreen", "XDG_DATA_HOME": str(tmp_path)}
    times: list[float] = []
    for seed in range(count(12, 500)):
        chance = random.Random(seed)
        command, folder = COMMANDS[seed % len(COMMANDS)], tmp_path / str(seed)
        (folder / "new").mkdir(parents=True)
        for name, content in inputs.items():
            (folder / name).write_bytes(content)
        with begun(BEGUN, *command.split(), folder=folder, environment=environment) as process:
            try:
                out, errors = process.communicate(timeout=chance.uniform(0, LATEST))
            except subprocess.TimeoutExpired:
                interrupted = time.monotonic()
                process.send_signal(signal.SIGINT)
                out, errors = process.communicate(timeout=HANG)
                times.append(time.monotonic() - interrupted)
        context = f"seed {seed}, {command}: status {process.returncode}\n{out[-2000:]}{errors}"
        assert process.returncode in (0, INTERRUPTED), context
        assert "Traceback" not in errors, context
        faults = torn_files(folder, inputs)
        assert not faults, f"{faults}\n{context}"
    late, last = [f"{taken:.2f}" for taken in sorted(times) if taken > WITHIN], max(times, default=0.0)
    print(f"{len(times)} of {count(12, 500)} commands interrupted, the last after {last:.2f} s; late: {late}")  # noqa: T201


def torn_files(folder: Path, inputs: dict[str, bytes]) -> list[str]:
    """Return the changed inputs, the incomplete outputs and the temporary files."""
    faults = [name for name, given in inputs.items() if name != "old.mcap" and (folder / name).read_bytes() != given]
    replaced = (folder / "old.mcap").read_bytes() != inputs["old.mcap"]
    if replaced and read_log(folder / "old.mcap").torn is not None:
        faults.append("old.mcap")
    for path in folder.rglob("*"):
        if path.name.startswith(".sonarhw"):
            faults.append(path.name)
        elif path.suffix == ".mcap":
            read_log(path)
        elif not path.read_bytes().endswith(ENDS.get(path.suffix, b"")) if path.is_file() else False:
            faults.append(path.name)
    return faults
