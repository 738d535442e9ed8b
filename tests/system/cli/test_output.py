"""Files that commands write: with a known suffix, never over their input, completely or not at all."""

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from sonarhw_cli.app import run
from sonarhw_cli.options import LOG
from sonarhw_cli.outputs import atomic_file, checked_out, text_output

from sonarhw.errors import InputError
from sonarhw.export import export_suffixes
from sonarhw.log.writer import write_scan
from tests.checkout import CHECKOUT
from tests.fixtures.example_logs import METADATA, example_reading, write_example

ROOM = CHECKOUT / "rooms" / "simple.toml"
IMPORT = ["--heading", "deg", "--range", "m"]
MAIN = "from sonarhw_cli.entry import main; main()"


@pytest.mark.parametrize("by", ["its name", "a link", "a hard link"])
@pytest.mark.parametrize("command", ["import", "simulate", "paths", "compare", "export", "recover"])
def test_no_command_overwrites_its_input(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str, by: str
) -> None:
    # the suffix selects the format, so most commands reach their own input only under a second name
    ending = {"import": ".mcap", "recover": ".mcap", "export": ".mcap", "compare": ".png"}.get(command, ".csv")
    read, out = tmp_path / f"own{ending}", tmp_path / f"out{ending}"
    log = command in ("compare", "export", "recover")
    if log:
        write_example(read, 4)
    elif command == "import":
        read.write_text("deg,m\n0,1\n")
    else:
        shutil.copy(ROOM, read)
    match by:
        case "a link":
            out.symlink_to(read)
        case "a hard link":
            out.hardlink_to(read)
        case _:
            out = tmp_path / ".." / tmp_path.name / read.name
    before = read.read_bytes()
    arguments = {
        "import": ["import", read, *IMPORT, "--out", out],
        "simulate": ["simulate", read, "--place", "figure9", "--out", out],
        "paths": ["paths", read, "--place", "figure9", "--out", out],
        "compare": ["compare", read, "--room", ROOM, "--plot", out],
    }.get(command, ["log", command, read, "--out", out])
    assert run([*map(str, arguments), "--force"]) == 2
    error = capsys.readouterr().err
    assert "is the input file" in error
    assert error.count("\n") == 1
    assert read.read_bytes() == before


@pytest.mark.parametrize(
    ("command", "out", "wanted"),
    [
        ("import", "-", ".mcap"),
        ("import", "x.csv", ".mcap"),
        ("import", "x", ".mcap"),
        ("recover", "-", ".mcap"),
        ("recover", "x.csv", ".mcap"),
        ("paths", "x.npz", ".csv, or - for standard output"),
        ("paths", "x.mcap", ".csv, or - for standard output"),
        ("simulate", "x.docx", ".csv, .npz, .png, .pdf, .svg, .mcap, .gif, .mp4 or .webm, or - for standard output"),
        ("simulate", ".csv", ".csv, .npz, .png, .pdf, .svg, .mcap, .gif, .mp4 or .webm, or - for standard output"),
        ("export", "x.png", f"{', '.join(export_suffixes())} or .mcap, or - for standard output"),
        ("compare", "-", ".png, .pdf or .svg"),
        ("compare", "x.gif", ".png, .pdf or .svg"),
    ],
)
def test_an_output_name_must_have_a_known_suffix(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    command: str,
    out: str,
    wanted: str,
) -> None:
    folder = tmp_path / "empty"
    folder.mkdir()
    write_example(tmp_path / "scan.mcap", 4)
    (tmp_path / "own.csv").write_text("deg,m\n0,1\n")
    monkeypatch.chdir(folder)
    arguments = {
        "import": ["import", "../own.csv", *IMPORT],
        "compare": ["compare", "../scan.mcap", "--room", str(ROOM)],
        "simulate": ["simulate", str(ROOM), "--place", "figure9"],
        "paths": ["paths", str(ROOM), "--place", "figure9"],
    }.get(command, ["log", command, "../scan.mcap"])
    option = "--plot" if command == "compare" else "--out"
    assert run([*arguments, option, out]) == 2
    assert capsys.readouterr() == ("", f"sonarhw: {option} {out}: expected a name ending in {wanted}\n")
    assert [*folder.iterdir()] == []


def test_a_suffix_may_be_in_capitals(tmp_path: Path) -> None:
    assert run(["simulate", str(ROOM), "--place", "figure9", "--out", str(tmp_path / "SCAN.NPZ")]) == 0
    assert (tmp_path / "SCAN.NPZ").read_bytes().startswith(b"PK")


@pytest.mark.parametrize("ending", [".csv", ".npz", ".mcap"])
def test_a_folder_as_output_file_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], ending: str) -> None:
    out = tmp_path / f"d{ending}"
    out.mkdir()
    assert run(["simulate", str(ROOM), "--place", "figure9", "--out", str(out), "--force"]) == 2
    assert capsys.readouterr().err == f"sonarhw: --out {out}: is a folder; give the name of a file in it\n"


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


@pytest.mark.parametrize("there", [False, True])
@pytest.mark.parametrize(
    ("command", "name"),
    [
        ("simulate", "scan.csv"),
        ("simulate", "scan.npz"),
        ("simulate", "scan.png"),
        ("export", "scan.csv"),
        ("export", "scan.npz"),
        ("compare", "plot.png"),
        ("simulate", "scan.mcap"),
        ("import", "scan.mcap"),
        ("export", "scan.mcap"),
        ("recover", "scan.mcap"),
    ],
)
def test_a_full_disk_leaves_no_incomplete_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str, name: str, there: bool
) -> None:
    log, table, folder = tmp_path / "example.mcap", tmp_path / "own.csv", tmp_path / "results"
    write_example(log, 40)
    table.write_text("deg,m\n0,1\n5,1\n")
    folder.mkdir()
    arguments = {
        "import": ["import", str(table), *IMPORT, "--force", "--out"],
        "recover": ["log", "recover", str(log), "--force", "--out"],
        "simulate": ["simulate", str(ROOM), "--place", "figure9", "--force", "--out"],
        "export": ["log", "export", str(log), "--force", "--out"],
        "compare": ["compare", str(log), "--room", str(ROOM), "--force", "--plot"],
    }[command]
    # first without a limit: compiling and listing fonts write files of their own
    assert run([*arguments, str(tmp_path / name)]) == 0
    capsys.readouterr()
    out = folder / name
    if there:
        out.write_text("older")
    with full_disk():
        status = run([*arguments, str(out)])
    message = f"sonarhw: {out}: File too large; choose another file\n"
    out_text, err = capsys.readouterr()
    errors = [line for line in err.splitlines(keepends=True) if "warning" not in line]
    assert (status, out_text, errors) == (1, "", [message])
    assert [path.read_text() for path in folder.iterdir()] == ["older"] * there


def test_a_full_file_system_leaves_the_old_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    disk, log = tmp_path / "disk", tmp_path / "long.mcap"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", disk], check=False).returncode != 0:
        pytest.skip("only root can mount a small file system")
    try:
        write_example(disk / "scan.mcap", 4)
        before = (disk / "scan.mcap").read_bytes()
        write_example(log, 400)
        for command in ("export", "recover"):
            assert run(["log", command, str(log), "--out", str(disk / "scan.mcap"), "--force"]) == 1
            assert "No space left on device; delete other files" in capsys.readouterr().err
            assert [path.read_bytes() for path in disk.iterdir()] == [before]
    finally:
        subprocess.run(["umount", disk], check=True)


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    out = tmp_path / "scan.csv"
    out.write_text("older")
    with suppress(KeyboardInterrupt), atomic_file(out, overwrite=True) as file:
        file.write(b"newer")
        file.flush()
        raise KeyboardInterrupt
    assert [path.read_text() for path in tmp_path.iterdir()] == ["older"]


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


def test_a_device_is_written_to_and_not_replaced(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["simulate", str(ROOM), "--place", "figure9", "--out"]
    assert run([*command, "/dev/full"]) == 1
    message = "sonarhw: /dev/full: No space left on device; delete other files or choose another file\n"
    assert capsys.readouterr().err == message
    assert run([*command, "/dev/null"]) == 0
    assert Path("/dev/null").is_char_device()


def test_a_pipe_receives_the_same_output_as_a_file(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with subprocess.Popen(["cat", pipe], stdout=subprocess.PIPE, text=True) as cat:
        assert run(["simulate", str(ROOM), "--place", "figure9", "--out", str(pipe)]) == 0
        assert cat.stdout is not None
        assert cat.stdout.read().count("\n") == 73
    assert pipe.is_fifo()


EXPORT = ["log", "export", "scan.mcap", "--out", "-"]
CLOSED = (">&-", "standard output: is closed; leave it open, or name a file with --out")
FULL = (">/dev/full", "standard output: No space left on device; name a file with --out")


@pytest.mark.parametrize(
    ("arguments", "redirection", "message", "unbuffered"),
    [
        (EXPORT, *CLOSED, ""),
        (EXPORT, *CLOSED, "1"),
        (EXPORT, *FULL, ""),
        (EXPORT, *FULL, "1"),
        (["simulate", ROOM, "--place", "figure9", "--step", "90"], *CLOSED, ""),
        (["paths", ROOM, "--place", "figure9"], *FULL, ""),
    ],
    ids=["closed", "closed, unbuffered", "full", "full, unbuffered", "simulate", "paths"],
)
def test_standard_output_that_cannot_be_written_gives_an_error_of_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str | Path],
    redirection: str,
    message: str,
    unbuffered: str,
) -> None:
    # Python flushes a buffer that could not be written again at exit
    monkeypatch.setenv("PYTHONUNBUFFERED", unbuffered)
    write_example(tmp_path / "scan.mcap", 4)
    command = shlex.join([sys.executable, "-c", MAIN, *map(str, arguments)])
    done = subprocess.run(
        f"{command} {redirection}", shell=True, cwd=tmp_path, stderr=subprocess.PIPE, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (1, f"sonarhw: {message}\n")


@pytest.mark.parametrize("arguments", [["log", "info", "scan.mcap"], ["--version"], ["--help"], ["ports", "--json"]])
def test_a_closed_standard_output_is_an_error_of_every_command_that_prints(
    tmp_path: Path, arguments: list[str]
) -> None:
    write_example(tmp_path / "scan.mcap", 4)
    command = shlex.join([sys.executable, "-c", MAIN, *arguments])
    done = subprocess.run(f"{command} >&-", shell=True, cwd=tmp_path, stderr=subprocess.PIPE, text=True, check=False)
    message = "sonarhw: standard output: is closed; leave it open, or redirect it to a file\n"
    # `ports` also says that there are none, as on a new machine
    assert (done.returncode, done.stderr.removeprefix("no serial ports\n")) == (1, message)


def test_a_command_that_prints_nothing_needs_no_standard_output(tmp_path: Path) -> None:
    write_example(tmp_path / "scan.mcap", 4)
    streams = "import os; print(sorted(int(n) for n in os.listdir('/proc/self/fd'))[:3], file=open('streams', 'w'))"
    main = f"from sonarhw_cli import entry; entry._occupy_closed_streams(); {streams}; entry.main()"
    command = shlex.join([sys.executable, "-c", main, "log", "export", "scan.mcap", "--out", "scan.csv"])
    subprocess.run(f"{command} <&- >&- 2>&-", shell=True, cwd=tmp_path, check=True)
    assert (tmp_path / "scan.csv").read_text().startswith("time_s,")
    # no file of the command has the number of a standard stream
    assert (tmp_path / "streams").read_text() == "[0, 1, 2]\n"


def test_a_reader_that_closes_the_pipe_ends_a_command_quietly(tmp_path: Path) -> None:
    # more than a pipe holds
    write_scan(tmp_path / "scan.mcap", METADATA, [example_reading(number, angle=0.0) for number in range(4000)])
    command = [sys.executable, "-c", MAIN, "log", "export", "scan.mcap", "--out", "-"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "time_s,heading_deg,range_m,echoes_s\n"
        process.stdout.close()
        assert process.stderr is not None
        assert process.stderr.read() == ""
    assert process.returncode == 0


@pytest.mark.parametrize(
    "given",
    [
        "{}",
        "fake:{}",
        "fake:{}?place=figure9&seed=1",
        "fake:room.toml?board={}",
        "fake:room.toml?place=figure9&board={}&seed=1",
    ],
)
def test_the_room_file_and_the_board_of_a_url_are_input_files(tmp_path: Path, given: str) -> None:
    room = tmp_path / "own.mcap"
    room.write_text("name = 'own'")
    with pytest.raises(InputError, match="is the input file"):
        checked_out(room, (LOG,), True, None, "paper", "socket://127.0.0.1:4000", given.format(room))


def test_the_log_on_standard_output_is_not_the_exported_one(tmp_path: Path) -> None:
    write_example(tmp_path / "scan.mcap", 4)
    before = (tmp_path / "scan.mcap").read_bytes()
    for out in ("-", "/dev/stdout", "/dev/fd/1"):
        arguments = ["log", "export", "scan.mcap", "--out", out]
        with (tmp_path / "scan.mcap").open("ab") as appended:
            done = subprocess.run(
                [sys.executable, "-c", MAIN, *arguments],
                cwd=tmp_path,
                stdout=appended,
                stderr=subprocess.PIPE,
                text=True,
            )
        assert done.returncode == 2
        assert "is the input file scan.mcap" in done.stderr
    assert (tmp_path / "scan.mcap").read_bytes() == before


@pytest.mark.parametrize("out", ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"])
def test_an_open_file_is_continued_and_not_truncated(tmp_path: Path, out: str) -> None:
    write_example(tmp_path / "scan.mcap", 4)
    results = tmp_path / "results.csv"
    results.write_text("earlier\n")
    command = shlex.join([sys.executable, "-c", MAIN, "log", "export", str(tmp_path / "scan.mcap"), "--out", out])
    subprocess.run(f"({command}; echo later) >> {results}", shell=True, check=True)
    lines = results.read_text().splitlines()
    assert (lines[0], lines[1], len(lines), lines[-1]) == ("earlier", "time_s,heading_deg,range_m,echoes_s", 7, "later")


def test_a_file_name_with_a_question_mark_is_an_input_file(tmp_path: Path) -> None:
    log = tmp_path / "why?.mcap"
    log.write_text("mine")
    with pytest.raises(InputError, match="is the input file"):
        checked_out(log, (LOG,), True, log)


def test_a_folder_in_dev_is_not_a_device() -> None:
    with pytest.raises(InputError, match="expected a name ending in"):
        checked_out("/dev/fd", (LOG,), True)
    with pytest.raises(InputError, match="expected a name ending in"):
        checked_out("/dev/nonesuch", (LOG,), True)
