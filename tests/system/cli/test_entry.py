"""A signal ends any command with status 130, without a traceback, and leaves the old file or none, whatever blocks."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from sonarhw_cli.entry import INTERRUPTED, UNWINDING

from sonarhw.log import read_log
from tests.checkout import CHECKOUT
from tests.fixtures.example_logs import write_example
from tests.hang_guard import HANG

# prints a line when it has started, so that Ctrl-C never comes before our first line of code
HANDLED = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # also in the background
BEGUN = HANDLED + "import sonarhw_cli.entry, os; os.write(1, b'begun\\n'); sonarhw_cli.entry.main()"
# a command that executes the code in its first argument
ANY = (
    HANDLED
    + """
import sys, time
from sonarhw_cli import app, entry
def begin():
    print("begun", flush=True)
    time.sleep(60)
def run():
    exec(sys.argv[1])
    return 0
app.run = run
entry.main()
"""
)
# what libraries do with a KeyboardInterrupt
LOST = """
try:
    begin()
except BaseException:
    time.sleep(60)
"""
WRAPPED = """
try:
    begin()
except BaseException:
    raise SystemError("compiled badly")
"""
PRINTED = """
class Thing:
    def __del__(self):
        begin()
Thing()
raise TypeError("half made")
"""
CLEANUP = """
entry.UNWINDING = 60
try:
    begin()
finally:
    print("cleanup", flush=True)
    time.sleep(60)
"""
# Ctrl-C while numba converts the result of a kernel
CONVERTED = """
import signal
from numba.core import serialize
from sonarhw_sim.rays.fan import no_candidates, with_other
class Types(dict):
    def __getitem__(self, key):
        signal.raise_signal(signal.SIGINT)
        return super().__getitem__(key)
serialize._unpickled_memo = Types()
print("begun", flush=True)
with_other(no_candidates(), 0, 0, no_candidates(), 0, 0)
while True:
    pass
"""
# Ctrl-C while the import of Qt for Python runs Python
IMPORTED = """
import signal, sys
def interrupt(frame, event, argument):
    if "shibokensupport" in frame.f_code.co_filename:
        sys.setprofile(None)
        signal.raise_signal(signal.SIGINT)
sys.setprofile(interrupt)
print("begun", flush=True)
import PySide6.QtCore
while True:
    pass
"""
# one long call of compiled code, during which Python calls no signal handler
BUSY = "import hashlib" + CLEANUP.replace("time.sleep(60)", "hashlib.pbkdf2_hmac('sha256', b'', b'', 10**9)")


ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join([str(CHECKOUT), os.environ.get("PYTHONPATH", "")])}


@contextmanager
def begun(
    code: str, *arguments: str, folder: Path, environment: dict[str, str] = ENVIRONMENT, errors: int = subprocess.PIPE
) -> Iterator[subprocess.Popen[str]]:
    """Yield a running Python program that has printed `begun`."""
    command = [sys.executable, "-c", code, *arguments]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=errors, text=True, cwd=folder, env=environment
    ) as process:
        try:
            assert "begun\n" in iter(process.stdout.readline, "")
            yield process
        finally:
            process.kill()


@pytest.mark.parametrize("reaction", [LOST, WRAPPED, PRINTED], ids=["lost", "wrapped", "printed"])
def test_ctrl_c_ends_a_command_quietly_if_a_library_changes_the_exception(reaction: str, tmp_path: Path) -> None:
    with begun(ANY, reaction, folder=tmp_path) as process:
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=HANG) == ("", "")
    assert process.returncode == INTERRUPTED


@pytest.mark.parametrize("cleanup", [CLEANUP, BUSY], ids=["asleep", "busy"])
def test_a_second_ctrl_c_ends_a_command_at_once(cleanup: str, tmp_path: Path) -> None:
    with begun(ANY, cleanup, folder=tmp_path) as process:
        process.send_signal(signal.SIGINT)
        assert process.stdout.readline() == "cleanup\n"
        process.send_signal(signal.SIGINT)
        process.wait(timeout=HANG)
    assert process.returncode == INTERRUPTED


def test_an_exception_without_ctrl_c_gives_a_traceback(tmp_path: Path) -> None:
    with begun(ANY, "print('begun'); raise ZeroDivisionError", folder=tmp_path) as process:
        _, errors = process.communicate(timeout=HANG)
    assert process.returncode == 1
    assert "ZeroDivisionError" in errors


# a plug-in that blocks in the call that its URL names, in native code, during which no Python code of its process runs
BLOCKING = """
import ctypes, math, sys, time
from sonarhw import DeviceIdentity, DevicePlugin, Measurement

def block():
    ctypes.PyDLL(None).sleep(600)

if "blocking:import" in sys.argv:
    print("begun", flush=True)
    block()

class Blocking(DevicePlugin):
    calls = 0

    def block(self, place):
        if self.url == f"blocking:{place}":
            print("begun", flush=True)
            block()

    def __init__(self, url):
        super().__init__(url)
        self.block("init")

    @property
    def identity(self):
        self.block("identity")
        return DeviceIdentity("blocking")

    def open(self):
        self.block("open")

    def begin(self, order):
        self.block("begin")
        return True

    def read(self):
        time.sleep(0.001)
        self.calls += 1
        if self.calls == 200 and self.url == "blocking:stopped":
            print("begun", flush=True)
        if self.calls > 200:
            self.block("read")
        angle = math.radians(abs(self.calls % 20 - 10))
        return [Measurement(angle, (1.0,))]

    def end(self):
        self.block("end")
        if self.url == "blocking:stopped":
            block()

    @property
    def ignored(self):
        self.block("ignored")
        return {}

    def close(self):
        pass
"""
CALLED = {
    "scan": "import identity begin read end ignored stopped",  # stopped: `end`, after Ctrl-C in a scan
    "gui": "import init",  # it scans on request only
    "serve": "open read",
}
KEPT = ("read", "stopped")  # calls before which a scan has readings
POINTS = "[sonarhw.devices]\nblocking = blocking:Blocking\n"


@pytest.fixture
def with_plugin(tmp_path: Path) -> dict[str, str]:
    """Return an environment in which the plug-in that blocks is installed."""
    packages = tmp_path / "packages"
    metadata = packages / "blocking-1.0.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: blocking\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(POINTS)
    (packages / "blocking.py").write_text(BLOCKING)
    return {**ENVIRONMENT, "PYTHONPATH": os.pathsep.join((str(packages), ENVIRONMENT["PYTHONPATH"]))}


@pytest.mark.parametrize(
    ("command", "call"), [(name, call) for name, calls in CALLED.items() for call in calls.split()]
)
def test_ctrl_c_ends_a_blocked_plugin(command: str, call: str, tmp_path: Path, with_plugin: dict[str, str]) -> None:
    code = HANDLED + "from sonarhw_cli.entry import main; main()"
    options = {
        "scan": ["--out", "scan.mcap", "--sweeps", "1000" if call in KEPT else "2"],
        "serve": ["--foxglove", "--tcp", "127.0.0.1:0"],
    }
    environment = {**with_plugin, "QT_QPA_PLATFORM": "offscreen", "XDG_DATA_HOME": str(tmp_path)}
    arguments = [command, f"blocking:{call}", *options.get(command, [])]
    # what a plug-in prints goes to standard error
    with begun(code, *arguments, folder=tmp_path, environment=environment, errors=subprocess.STDOUT) as process:
        process.send_signal(signal.SIGINT)
        errors, _ = process.communicate(timeout=HANG)
    assert (process.returncode, "Traceback" in errors) == (INTERRUPTED, False)
    if command == "scan" and call in KEPT:
        assert len(read_log(tmp_path / "scan.mcap").readings) > 100
        assert "kept in scan.mcap" in errors


# what a library may leave: a thread that never ends, and an object that needs long to be freed
THREAD = "import threading; threading.Thread(target=threading.Event().wait).start()"
FREED = """
class Slow:
    def __del__(self, sleep=time.sleep):
        sleep(600)
sys.modules["slow"] = Slow()
"""


ENDS = {
    "result of a kernel": (CONVERTED, INTERRUPTED),
    "import of Qt": (IMPORTED, INTERRUPTED),
    "thread": (f"print('begun', flush=True)\n{THREAD}", 0),
    "memory": (f"print('begun', flush=True)\n{FREED}", 0),
}


@pytest.mark.parametrize(("code", "status"), ENDS.values(), ids=ENDS.keys())
def test_what_a_library_does_or_leaves_holds_no_command(code: str, status: int, tmp_path: Path) -> None:
    with begun(ANY, code, folder=tmp_path) as process:
        assert process.communicate(timeout=HANG) == ("", "")
    assert process.returncode == status


def test_a_command_ends_within_two_seconds_of_ctrl_c() -> None:
    assert UNWINDING < 2


# unfinished files


# a command that prints a line when all of its file is written but not yet renamed, and then waits
WAITING = """
import os, signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # also in the background
def wait(_):
    try:
        os.write(1, b"begun\\n")
        {}
    except BaseException:
        {}
os.fsync = wait
import sonarhw_cli.entry
sonarhw_cli.entry.main()
"""
SLEEPING = ("time.sleep(600)", "raise")
# the first signal is swallowed, as by some libraries
SWALLOWING = ("time.sleep(600)", 'os.write(1, b"swallowed\\n"); sonarhw_cli.entry.UNWINDING = 600; time.sleep(600)')
HANGING_UP = ("os.kill(os.getpid(), signal.SIGHUP)", "raise")
OLD = b"older"
COMMANDS = {
    "csv": ["log", "export", "source.mcap", "--out", "new/scan.csv"],
    "export": ["log", "export", "source.mcap", "--out", "new/scan.mcap"],
    "recover": ["log", "recover", "source.mcap", "--out", "new/scan.mcap"],
    "import": ["import", "own.csv", "--heading", "deg", "--range", "m", "--out", "new/scan.mcap"],
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a log, a table, and an empty folder `new`."""
    write_example(tmp_path / "source.mcap", 4)
    (tmp_path / "own.csv").write_text("deg,m\n0,1\n5,1\n")
    (tmp_path / "new").mkdir()
    return tmp_path


@pytest.mark.parametrize(
    ("name", "number"),
    [*((name, signal.SIGINT) for name in COMMANDS), ("export", signal.SIGTERM), ("export", signal.SIGHUP)],
)
def test_a_signal_leaves_the_old_file_and_no_hidden_one(folder: Path, name: str, number: signal.Signals) -> None:
    out = folder / COMMANDS[name][-1]
    out.write_bytes(OLD)
    with begun(WAITING.format(*SLEEPING), *COMMANDS[name], "--force", folder=folder) as process:
        assert len([*out.parent.iterdir()]) == 2
        process.send_signal(number)
        assert process.communicate(timeout=HANG) == ("", "")
    assert process.returncode == INTERRUPTED
    assert {path.name: path.read_bytes() for path in out.parent.iterdir()} == {out.name: OLD}


@pytest.mark.parametrize("force", [["--force"], []], ids=["an old file", "none"])
def test_sigkill_leaves_the_old_file_or_none(folder: Path, force: list[str]) -> None:
    out = folder / COMMANDS["export"][-1]
    if force:
        out.write_bytes(OLD)
    with begun(WAITING.format(*SLEEPING), *COMMANDS["export"], *force, folder=folder) as process:
        process.kill()
    assert (out.read_bytes() if out.exists() else b"") == (OLD if force else b"")


def test_a_second_signal_leaves_no_hidden_file_even_if_a_library_swallows_the_first(folder: Path) -> None:
    with begun(WAITING.format(*SWALLOWING), *COMMANDS["export"], folder=folder) as process:
        process.send_signal(signal.SIGTERM)
        assert process.stdout.readline() == "swallowed\n"
        process.send_signal(signal.SIGTERM)
        process.wait(timeout=HANG)
    assert process.returncode == INTERRUPTED
    assert [*(folder / "new").iterdir()] == []


def test_a_hangup_that_nohup_ignores_is_ignored(folder: Path) -> None:
    ignoring = f"import signal; signal.signal(signal.SIGHUP, signal.SIG_IGN)\n{WAITING.format(*HANGING_UP)}"
    done = subprocess.run([sys.executable, "-c", ignoring, *COMMANDS["export"]], cwd=folder, check=False)
    assert done.returncode == 0
    assert [path.name for path in (folder / "new").iterdir()] == ["scan.mcap"]
