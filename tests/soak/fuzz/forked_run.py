"""Run one case in a child process with limits, and find what is wrong with its result."""

import json
import os
import re
import resource
import signal
import sys
import time
import traceback
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

from sonarhw_cli.app import run

from tests.hang_guard import HANG
from tests.soak.fuzz.command_lines import Case
from tests.soak.fuzz.foreign_files import EXECUTED

PROCESSOR, SLOW_PROCESSOR = 10, 180  # s, for one command
MEMORY = 1 << 30  # bytes, of one command, besides what is loaded before it
_UNTIL_STOPPED = 0.3  # s before an endless command is stopped, if it prints nothing
_STATUSES = (0, 1, 2, 130)
_CRASHED = 70
_BUSY = 0.002  # share of a core that a command uses at least while it computes, also on a loaded machine
_ENDLESS = 10 * HANG  # s; no command takes so long, even then
_OUT, _ERR = ".stdout", ".stderr"
_LINES = re.compile(r"sonarhw: .*\n")
_WARNINGS = re.compile(r"((sonarhw: warning|ignored|--place .*): .*\n|the unit is assumed.*\n)*")  # and notes
_PYTHON = re.compile(r"Traceback|\w+Warning: |Exception ignored|\.py:\d+")


@dataclass(frozen=True)
class Ended:
    """How a command ended."""

    status: int  # negative: the signal
    output: str
    error: str
    memory: int  # bytes
    seconds: float  # processor time
    waited: bool  # longer than any command should, without computing


def faults_of(case: Case, folder: Path) -> tuple[list[str], Ended]:
    """Run a case in an empty folder. Return what is wrong, in words, and how the command ended."""
    os.mkfifo(folder / "pipe")
    for name, content in case.files.items():
        (folder / name).write_bytes(content)
    before = _contents(folder)
    ended = _run(case, folder)
    return [*_faults(case, ended), *_harm(case, ended, before, _contents(folder))], ended


def _run(case: Case, folder: Path) -> Ended:
    sys.stdout.flush()
    for name in (_OUT, _ERR):
        (folder / name).touch()  # also if the child is stopped before it opens them
    child = os.fork()
    if child == 0:
        os._exit(_child(case, folder))
    began, stopped, waited = time.monotonic(), False, False
    while True:
        done, status, usage = os.wait4(child, os.WNOHANG)
        if done:
            break
        passed = time.monotonic() - began
        if case.endless and not stopped and (passed > _UNTIL_STOPPED or _size(folder / _OUT)):
            os.kill(child, signal.SIGTERM)
            stopped = True
        if passed > HANG and (passed > _ENDLESS or _processor_time(child) < _BUSY * passed):
            waited = True
            os.kill(child, signal.SIGKILL)
        time.sleep(0.005)
    _kill_group(child)
    output, error = ((folder / name).read_text("utf-8", "surrogateescape") for name in (_OUT, _ERR))
    seconds = usage.ru_utime + usage.ru_stime
    return Ended(os.waitstatus_to_exitcode(status), output, error, usage.ru_maxrss * 1024, seconds, waited)


def _child(case: Case, folder: Path) -> int:
    os.setsid()
    os.chdir(folder)
    for number, name in ((1, _OUT), (2, _ERR)):
        os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), number)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    sys.stdin, sys.stdout, sys.stderr = sys.__stdin__, sys.__stdout__, sys.__stderr__
    seconds = SLOW_PROCESSOR if case.slow else PROCESSOR
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 2))
    resource.setrlimit(resource.RLIMIT_AS, (_pages(0) + MEMORY, _pages(0) + MEMORY))
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 28, 1 << 28))
    try:
        return run(case.arguments)
    except SystemExit as end:
        return int(end.code or 0)
    except BaseException:  # noqa: BLE001 - every error is a fault
        traceback.print_exc()
        return _CRASHED
    finally:
        sys.stdout.flush()
        sys.stderr.flush()


def _processor_time(process: int) -> float:
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _pages(column: int) -> int:
    """Return the size of this process in bytes: virtual (column 0) or resident (1)."""
    return int(Path("/proc/self/statm").read_text().split()[column]) * resource.getpagesize()


def _size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


def _kill_group(leader: int) -> None:
    with suppress(ProcessLookupError):
        os.killpg(leader, signal.SIGKILL)


def _contents(folder: Path) -> dict[Path, bytes]:
    return {
        path.relative_to(folder): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in (_OUT, _ERR)
    }


def _faults(case: Case, ended: Ended) -> Iterator[str]:
    if ended.waited:
        yield f"waits for more than {HANG:g} s"
    elif ended.status in (-signal.SIGXCPU, -signal.SIGKILL):
        yield f"is stopped after {ended.seconds:.0f} s of processor time"
    elif ended.status not in (*_STATUSES, *((-signal.SIGTERM,) if case.endless else ())):
        yield f"exit status {ended.status}"
    if ended.memory > MEMORY + _pages(1):
        yield f"needs {ended.memory / 1e9:.1f} GB"
    if found := _PYTHON.search(ended.error):
        yield f"prints {found[0]!r}"
    elif ended.status in (1, 2) and not _one_error(ended.error) and not _explains(case):
        yield "does not print one line about the error"
    raw = {character for character in ended.output + ended.error if not character.isprintable()} - {"\n"}
    if raw and "-" not in case.outputs:
        yield f"prints raw {sorted(raw)}"
    if max(map(len, ended.error.splitlines()), default=0) > 1001:
        yield "prints a very long line"
    options = [*takewhile(lambda argument: argument != "--", case.arguments)]
    if ended.status == 0 and "--json" in options and not _is_json(ended.output):
        yield "prints invalid JSON"


def _explains(case: Case) -> bool:
    """Return whether a command prints more than one line: each finding, or what it does before it fails."""
    words = case.arguments[1:] if case.arguments[:1] == ["--"] else case.arguments
    return words[:2] in (["room", "check"], ["profile", "check"]) or words[:1] in (["flash"], ["doctor"], ["monitor"])


def _one_error(error: str) -> bool:
    return error.startswith("Usage:") or bool(_LINES.fullmatch(_WARNINGS.sub("", error, count=1)))


def _is_json(text: str) -> bool:
    def refuse(constant: str) -> None:
        raise ValueError(constant)

    try:
        json.loads(text, parse_constant=refuse)
    except ValueError:
        return False
    return True


def _harm(case: Case, ended: Ended, before: dict[Path, bytes], after: dict[Path, bytes]) -> Iterator[str]:
    inputs = [path for path in before if str(path) not in case.outputs or "--force" not in case.arguments]
    for path in inputs:
        if after.get(path) != before[path]:
            yield f"harms {path}"
    new = [path for path in after if path not in before]
    if Path(EXECUTED) in new:
        yield "executes a file"
    for path in new:
        if ".part" in path.name or path.name.startswith(".sonarhw"):
            yield f"leaves {path}"
        elif ended.status in (1, 2) and not _kept(path) and not _explains(case):  # `room check --plot` draws the room
            yield f"leaves {path} though it failed"


def _kept(path: Path) -> bool:
    """Return whether a command keeps a file that it did not finish: a log, and the finished parts of a study."""
    return path.suffix == ".mcap" or path.parts[0].endswith(".d") or len(path.parts) > 1
