"""What commands print and write: output files, harmless text, and the progress of long work."""

import csv
import io
import json
import os
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
from sonarhw_cli.app import run
from sonarhw_cli.entry import INTERRUPTED
from sonarhw_cli.outputs import CompilationProgress, progress_of_share, text_output
from sonarhw_sim.board.profile import load_board

from sonarhw import link as ports
from sonarhw.host import scanner
from sonarhw.log.writer import write_scan
from tests.fixtures.commands import LINE_GONE, at_terminal, printed, seen, sonarhw
from tests.fixtures.example_logs import METADATA, example_reading, write_example
from tests.hang_guard import HANG


@contextmanager
def full_disk() -> Iterator[None]:
    """Limit the size of files, so that writing fails as on a full disk."""
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (500, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize(
    "command",
    [
        ("simulate", "simple", "--place", "figure9", "--out", "scan.csv"),
        ("simulate", "simple", "--place", "figure9", "--out", "scan.npz"),
        ("simulate", "simple", "--place", "figure9", "--out", "scan.png"),
        ("simulate", "simple", "--place", "figure9", "--out", "scan.mcap"),
        ("log", "export", "example.mcap", "--out", "scan.csv"),
        ("log", "export", "example.mcap", "--out", "scan.npz"),
        ("log", "export", "example.mcap", "--out", "scan.mcap"),
        ("log", "recover", "example.mcap", "--out", "scan.mcap"),
        ("compare", "example.mcap", "--room", "simple", "--plot", "scan.png"),
        ("import", "own.csv", "--heading", "deg", "--range", "m", "--out", "scan.mcap"),
    ],
    ids=" ".join,
)
def test_a_full_disk_leaves_no_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]) -> None:
    monkeypatch.chdir(tmp_path)
    write_example(Path("example.mcap"), 40)
    Path("own.csv").write_text("deg,m\n0,1\n5,1\n")
    out = Path(command[-1])
    printed(*command)  # without a limit: compiling and listing fonts write files of their own
    out.unlink()
    for contents in ([], ["older"]):
        for text in contents:
            out.write_text(text)
        before = {*tmp_path.iterdir()}
        with full_disk():
            done = sonarhw(*command, "--force")
        errors = [line for line in done.stderr.splitlines() if "warning" not in line]
        assert (done.returncode, done.stdout) == (1, "")
        assert errors == [f"sonarhw: {out}: File too large; choose another file"]
        assert {*tmp_path.iterdir()} == before
        assert [path.read_text() for path in (out,) if path.exists()] == contents


def test_a_full_file_system_leaves_the_old_log(tmp_path: Path) -> None:
    disk, log = tmp_path / "disk", tmp_path / "long.mcap"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", disk], check=False).returncode != 0:
        pytest.skip("only root can mount a small file system")
    try:
        write_example(disk / "scan.mcap", 4)
        before = (disk / "scan.mcap").read_bytes()
        write_example(log, 400)
        for command in ("export", "recover"):
            done = sonarhw("log", command, log, "--out", disk / "scan.mcap", "--force")
            assert done.returncode == 1
            assert "No space left on device; delete other files" in done.stderr
            assert [path.read_bytes() for path in disk.iterdir()] == [before]
    finally:
        subprocess.run(["umount", disk], check=True)


def test_an_overwritten_file_keeps_its_permissions_and_links(tmp_path: Path) -> None:
    out, link = tmp_path / "scan.csv", tmp_path / "newest.csv"
    out.write_text("older")
    out.chmod(0o640)
    link.symlink_to(out)
    with text_output(str(link), overwrite=True) as file:
        file.write("newer")
    assert link.is_symlink()
    assert out.read_text() == "newer"
    assert out.stat().st_mode & 0o777 == 0o640


def test_a_new_file_has_default_permissions(tmp_path: Path) -> None:
    with text_output(str(tmp_path / "scan.csv"), overwrite=False) as file:
        file.write("new")
    (tmp_path / "other").touch()
    assert (tmp_path / "scan.csv").stat().st_mode == (tmp_path / "other").stat().st_mode


def test_a_command_that_prints_nothing_needs_no_standard_output(tmp_path: Path) -> None:
    write_example(tmp_path / "scan.mcap", 4)
    streams = "import os; print(sorted(int(n) for n in os.listdir('/proc/self/fd'))[:3], file=open('streams', 'w'))"
    main = f"from sonarhw_cli import entry; entry._occupy_closed_streams(); {streams}; entry.main()"
    command = shlex.join([sys.executable, "-c", main, "log", "export", "scan.mcap", "--out", "scan.csv"])
    subprocess.run(f"{command} <&- >&- 2>&-", shell=True, cwd=tmp_path, check=True)
    assert (tmp_path / "scan.csv").read_text().startswith("time_s,")
    # no file of the command has the number of a standard stream
    assert (tmp_path / "streams").read_text() == "[0, 1, 2]\n"


# harmless text


EVIL = "\x1b]0;owned\x07\x9b2J\nsonarhw: done \u202e$\\frac$ <b>x</b>"
IN_TOML = json.dumps(EVIL)  # also a valid TOML string
NOT_UTF8 = os.fsdecode(b"no\xffsuch")


def hostile_room(folder: Path) -> Path:
    """Write a room with hostile names."""
    path = folder / "room.toml"
    path.write_text(
        f"name = {IN_TOML}\n[materials.m]\nreflectance = 0.9\n"
        '[[walls]]\nname = "=cmd()\\u001b"\nmaterial = "m"\nclosed = true\n'
        "points = [[0, 0], [1, 0], [1, 0.8], [0, 0.8]]\n"
        f"[places.{IN_TOML}]\nposition = [0.3, 0.4]\n[places.there]\nposition = [5.1, 0.4]\n"
    )
    return path


def hostile_log(folder: Path) -> Path:
    """Write a log with hostile names."""
    path = folder / "scan.mcap"
    metadata = replace(METADATA, room_file=EVIL, room_text="", place=EVIL, board=EVIL, made_by=EVIL)
    write_scan(path, metadata, [example_reading(number) for number in range(4)])
    return path


def hostile_board(folder: Path) -> Path:
    """Write a board profile with a hostile name."""
    path = folder / "board.toml"
    profile = load_board("paper")
    path.write_text(profile.text.replace(f'name = "{profile.name}"', f"name = {IN_TOML}"))
    return path


def harmless(capsys: pytest.CaptureFixture[str], *arguments: object, status: int = 0) -> str:
    """Run a command, and return what it printed, which must be harmless."""
    capsys.readouterr()
    assert run([*map(str, arguments)]) == status
    output, error = capsys.readouterr()
    assert_harmless(output + error)
    if status:
        assert error.count("\n") == 1
        assert len(error) <= 1001
    return output + error


def assert_harmless(text: str) -> None:
    assert {character for character in text if not character.isprintable()} <= {"\n"}
    assert not [line for line in text.splitlines() if line.startswith("sonarhw: done")]


@pytest.mark.parametrize(
    "arguments",
    [
        (EVIL,),
        ("profile", NOT_UTF8, "list"),
        ("log", "info", EVIL),
        ("log", "info", NOT_UTF8),
        ("simulate", NOT_UTF8),
        ("simulate", "room.toml", "--step", EVIL),
        ("simulate", "room.toml", "--model", EVIL),
        ("simulate", "room.toml", f"--{EVIL}"),
        ("scan", EVIL, "--out", "x.csv"),
        ("info", f"fake:{EVIL}?{EVIL}"),
        ("simulate", "room.toml", "--place", EVIL + 5000 * "x"),
        ("simulate", "room.toml", "--receiver", 5000 * "x\x1b"),
    ],
    ids=lambda arguments: repr(arguments)[:50],
)
def test_hostile_arguments(capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...]) -> None:
    assert "sonarhw: " in harmless(capsys, *arguments, status=2)


def test_hostile_names_in_a_room(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shown = harmless(capsys, "simulate", hostile_room(tmp_path), "--place", EVIL, "--step", 90)
    assert r"'=cmd()\x1b[" in shown  # a cell of CSV
    assert harmless(capsys, "simulate", hostile_room(tmp_path), "--place", "there", "--step", 90)
    assert r"\x1b]0;owned" in harmless(capsys, "simulate", hostile_room(tmp_path), "--place", "nowhere", status=2)
    harmless(capsys, "paths", hostile_room(tmp_path), "--place", EVIL)
    harmless(capsys, "simulate", hostile_room(tmp_path), "--place", EVIL, "--step", 90, "--out", tmp_path / "plan.png")
    assert (tmp_path / "plan.png").stat().st_size > 1000
    harmless(capsys, "simulate", hostile_room(tmp_path), "--place", EVIL, "--step", 90, "--out", tmp_path / "out.csv")
    first, *_ = csv.DictReader(io.StringIO((tmp_path / "out.csv").read_text()))
    assert first["via"].startswith(r"'=cmd()\x1b[")


def test_hostile_names_in_a_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert r"\x1b]0;owned" in harmless(capsys, "log", "info", hostile_log(tmp_path))
    harmless(capsys, "compare", tmp_path / "scan.mcap", status=2)
    harmless(
        capsys, "compare", tmp_path / "scan.mcap", "--room", hostile_room(tmp_path), "--board", "paper", "--place", EVIL
    )


def test_a_report_shows_names_as_text(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "report.html"
    rest = ("--room", hostile_room(tmp_path), "--board", "paper", "--place", EVIL, "--out", out)
    harmless(capsys, "report", hostile_log(tmp_path), *rest)
    page = out.read_text(encoding="utf-8")
    assert "&lt;b&gt;x&lt;/b&gt;" in page
    assert "<b>x</b>" not in page


def test_files_whose_names_are_not_utf_8(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, scan, again = (tmp_path / os.fsdecode(b"\xff" + suffix) for suffix in (b".toml", b".mcap", b"2.mcap"))
    hostile_room(tmp_path).rename(file)
    harmless(capsys, "simulate", file, "--place", EVIL, "--step", 90, "--out", scan)
    assert r"room      \udcff.toml" in harmless(capsys, "log", "info", scan)
    harmless(capsys, "log", "recover", scan, "--out", again)
    harmless(capsys, "report", scan, "--out", tmp_path / "report.html")
    assert r"\udcff.mcap" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_hostile_names_in_a_device(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    url = f"fake:{hostile_room(tmp_path)}?place=there&board={hostile_board(tmp_path)}&pace=max"
    assert r"\x1b]0;owned" in harmless(capsys, "info", url)


def test_hostile_names_of_ports(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ports, "serial_ports", lambda: [ports.Port("/dev/ttyUSB0", EVIL)])
    monkeypatch.setattr(scanner, "probe_port", lambda _: (False, EVIL))
    assert r"\x1b]0;owned" in harmless(capsys, "ports", "--ask")


def test_hostile_names_in_an_import(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scan\x1b[2J.csv"
    path.write_text('deg,"\x1b[2Jm"\n0,"\x1b[2J"\n')
    columns = ("--heading", "deg", "--range", "\x1b[2Jm")
    assert r"\x1b[2J" in harmless(capsys, "import", path, *columns, "--out", tmp_path / "out.mcap", status=2)


def test_a_terminal_with_few_characters_gets_escapes(tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-c",
        "from sonarhw_cli.entry import main; main()",
        "log",
        "info",
        str(hostile_log(tmp_path)),
    ]
    environment = os.environ | {"PYTHONIOENCODING": "iso8859-5"}
    done = subprocess.run(command, env=environment, capture_output=True, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (0, b"")
    assert rb"0\xb0 to 15\xb0" in done.stdout


# progress


BAR = "━"
PLAIN = "\x1b[0m"
COMMANDS = {
    "fit": ("searching", ["fit", "--place", "figure9", "--free", "heading", "--samples", "0", "--json"]),
    "locate": ("locating", ["locate", "--json", "--heading", "0"]),
    "compare": ("fitting", ["compare", "--place", "figure9", "--fit", "heading"]),
    "map": ("mapping", ["map", "--place", "figure9", "--json"]),
}


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A predicted scan of the simple room, by a board that hears only loud echoes, so searches are quick."""
    out = tmp_path_factory.mktemp("progress") / "scan.mcap"
    scan = ["simulate", "rooms/simple.toml", "--place", "figure9", "--board", "hc-sr04", "--step", "30"]
    assert run([*scan, "--out", str(out)]) == 0
    return str(out)


def test_progress_is_shown_on_a_terminal_only(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    doing, (command, *options) = COMMANDS["compare"]
    with at_terminal(command, log, *options) as (process, person):
        on_terminal = seen(person)
        printed, _ = process.communicate(timeout=HANG)
    assert process.returncode == 0
    assert doing in on_terminal
    assert BAR in on_terminal

    assert run([command, log, *options]) == 0
    in_pipe = capsys.readouterr()
    assert printed == in_pipe.out
    _, gone, after = on_terminal.rpartition(LINE_GONE)
    assert gone
    assert after == in_pipe.err.replace("\n", "\r\n")


@pytest.mark.parametrize("name", sorted(COMMANDS.keys() - {"compare"}))  # the test above shows that of compare
def test_every_long_command_shows_its_progress(name: str, log: str, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = fake_terminal(monkeypatch)
    doing, (command, *options) = COMMANDS[name]
    assert run([command, log, *options]) == 0
    assert doing in terminal.getvalue()
    assert BAR in terminal.getvalue()


def fake_terminal(monkeypatch: pytest.MonkeyPatch) -> StringIO:
    """Replace standard error of this process by a terminal, and return what is shown there."""
    terminal = StringIO()
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    return terminal


def test_without_a_terminal_few_lines_say_that_it_compiles(capsys: pytest.CaptureFixture[str]) -> None:
    shown = CompilationProgress()
    for done in range(30):
        shown.compiling(done, 50)
        shown.compiled()
    line = "sonarhw: Compiling the ray kernels, once per installation…"
    assert capsys.readouterr().err == f"{line}\n{line} 20 of 50\n"


def test_compilation_during_other_work_replaces_its_word(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = fake_terminal(monkeypatch)
    shown = CompilationProgress()
    with progress_of_share() as show:
        show(0.25, "searching")
        shown.compiling(0, 5)
        show(0.25, "still searching")
        shown.compiled()
        show(0.5, "refining")
    text = terminal.getvalue()
    assert "Compiling the ray kernels" in text
    assert "still searching" not in text
    assert "refining" in text
    assert "0/5" not in text
    assert text.endswith(LINE_GONE)


def test_ctrl_c_removes_the_progress_bar_and_ends_with_130(log: str) -> None:
    doing, (command, *options) = COMMANDS["fit"]
    with at_terminal(command, log, *options) as (process, person):
        seen(person, until=doing)
        os.write(person, b"\x03")
        shown = seen(person)
        printed, _ = process.communicate(timeout=HANG)
    assert process.returncode == INTERRUPTED
    assert printed == ""
    assert shown.removesuffix(PLAIN).endswith(LINE_GONE)
    assert "Traceback" not in shown
