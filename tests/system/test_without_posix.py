"""What Windows lacks is not needed: the product runs in an interpreter from which that is hidden."""

import os
import subprocess
import sys
from pathlib import Path

from tests.checkout import CHECKOUT

# read by every interpreter that the test starts, also by the processes of a study
HIDING = '''
import builtins, os, signal, socket, subprocess, sys, types, warnings

class System(types.ModuleType):
    """`sys` as the modules of this product see it."""

    platform = "win32"

    def __getattr__(self, name):
        return getattr(sys, name)

    def __setattr__(self, name, value):
        setattr(sys, name, value)

system, imported = System("sys"), builtins.__import__

def import_ours(name, names=None, *arguments, **named):
    if (names or {}).get("__name__", "").startswith("sonarhw"):
        if name in ("termios", "tty", "pty", "fcntl", "grp", "pwd", "resource"):
            raise ModuleNotFoundError(f"No module named {name!r}")
        if name == "sys":
            return system
    return imported(name, names, *arguments, **named)

def socketpair():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return socket.create_connection(server.getsockname()), server.accept()[0]

def refusing_open_files(function):
    def moved(path, *arguments, **named):
        for number in os.listdir("/proc/self/fd"):
            if os.path.realpath(f"/proc/self/fd/{number}") == os.path.realpath(path) != os.devnull:
                raise PermissionError(13, "The process cannot access the file because it is being used", str(path))
        return function(path, *arguments, **named)
    return moved

builtins.__import__ = import_ours
subprocess.CREATE_NO_WINDOW = 0
socket.socketpair = socketpair
for module, names in {os: "openpty fork getuid", signal: "pthread_sigmask SIGHUP", socket: "AF_UNIX"}.items():
    for name in names.split():
        delattr(module, name)
for name in ("rename", "replace", "unlink", "remove"):
    setattr(os, name, refusing_open_files(getattr(os, name)))
warnings.filterwarnings("error", category=EncodingWarning, module="sonarhw")
'''

PROGRAM = """
import atexit, importlib, pkgutil, subprocess, sys
from dataclasses import replace
from pathlib import Path
from PySide6.QtCore import QTimer
import sonarhw, sonarhw_cli, sonarhw_compare, sonarhw_gui, sonarhw_sim
from sonarhw_cli.app import run

for package in (sonarhw, sonarhw_sim, sonarhw_compare, sonarhw_gui, sonarhw_cli):
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)

from sonarhw.host.scanner import Scanner
from sonarhw.log import read_log
from sonarhw_gui.session.scanner import ScanSettings
from sonarhw_gui.window.start import WindowStart, run_window
from sonarhw_sim.board.profile import load_board
from sonarhw_gui.model.scene import scene_with
from sonarhw.readings import ScanOrder
from sonarhw_sim.room.room import load_room

folder = Path("C:/my scans")
folder.mkdir(parents=True)

def command(*arguments):
    assert run(list(arguments)) == 0, arguments

def served(*arguments):
    server = subprocess.Popen([sys.executable, "-m", "sonarhw", *arguments], stdout=subprocess.PIPE, encoding="utf-8")
    atexit.register(server.terminate)
    return server.stdout.readline().strip()

command("simulate", "kuc_siegel", "--place", "figure6", "--out", f"{folder}/predicted 1.csv")
url = served("fake", "kuc_siegel", "--place", "figure6", "--tcp", "127.0.0.1:0", "--pace", "max")
command("scan", url, "--out", f"{folder}/scan 1.mcap", "--room", "kuc_siegel", "--place", "figure6")
command("scan", url, "--out", f"{folder}/scan 1.mcap", "--room", "kuc_siegel", "--place", "figure6", "--force")
replayed = served("replay", f"{folder}/scan 1.mcap", "--tcp", "127.0.0.1:0", "--speed", "inf")
command("scan", replayed, "--out", "C:\\\\scan 2.mcap")
command("compare", "C:\\\\scan 2.mcap", "--room", "kuc_siegel", "--place", "figure6")
logs = (folder / "scan 1.mcap", "C:\\\\scan 2.mcap")
times = [[reading.echo_times for reading in read_log(path).readings] for path in logs]
assert times[0] == times[1] and len(times[0]) == 72
command("study", "study.toml", "--workers", "2", "--out", f"{folder}/study")

# the window scans, and its log has a name that Windows accepts
def close_at_the_end(window):
    session, timer = window.session, QTimer(window, interval=50)
    timer.timeout.connect(lambda: session.status.job.recording and not session.live.running and window.close())
    timer.start()

room = load_room("kuc_siegel")
room = replace(room, name='a<b>:"c/d|e?*')
scene = scene_with(load_board("paper"), room, room.places["figure6"], "kuc_siegel.toml")
start = WindowStart(scene, lambda: Scanner.open(url), order=ScanOrder(0.0, 0.5, 12), autostart=True,
    recordings=folder / "recordings", when_open=close_at_the_end)
assert run_window(start) == 0
(recording,) = (folder / "recordings").iterdir()
assert not set(recording.name) & set('<>:"/\\\\|?*'), recording
assert len(read_log(recording).readings) == 12
print("complete")
"""
STUDY = """
name = "test"
seed = 5
draws = 1
boards = ["paper"]
[[rooms]]
file = "{}"
places = ["figure6"]
[headings]
step = 30.0
[vary.board]
threshold_db = [-40, -36.5]
"""


def test_all_but_serial_ports_works_without_what_windows_lacks(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(HIDING, encoding="utf-8")
    (tmp_path / "study.toml").write_text(STUDY.format(CHECKOUT / "rooms" / "kuc_siegel.toml"), encoding="utf-8")
    path = os.pathsep.join([str(tmp_path), str(CHECKOUT), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "PYTHONPATH": path, "XDG_DATA_HOME": str(tmp_path), "QT_QPA_PLATFORM": "offscreen"}
    command = [sys.executable, "-X", "warn_default_encoding", "-c", PROGRAM]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.stdout.endswith("complete\n"), done.stdout + done.stderr
