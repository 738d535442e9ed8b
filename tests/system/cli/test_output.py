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
from sonarhw_cli.console.options import LOG, checked_out
from sonarhw_cli.console.output import atomic_file, text_output

from sonarhw.errors import InputError
from sonarhw.export.export_formats import export_suffixes
from tests.checkout import CHECKOUT
from tests.fixtures.example_logs import write_example

ROOM = CHECKOUT / "rooms" / "simple.toml"
IMPORT = ["--heading", "deg", "--range", "m"]


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
        ("simulate", "x.docx", ".csv, .npz, .png or .mcap, or - for standard output"),
        ("simulate", ".csv", ".csv, .npz, .png or .mcap, or - for standard output"),
        ("export", "x.png", f"{', '.join(export_suffixes())} or .mcap, or - for standard output"),
        ("compare", "-", ".png"),
        ("compare", "x.csv", ".png"),
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
    ],
)
def test_a_full_disk_leaves_no_incomplete_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str, name: str, there: bool
) -> None:
    log, folder = tmp_path / "scan.mcap", tmp_path / "results"
    write_example(log, 40)
    folder.mkdir()
    arguments = {
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
    message = f"sonarhw: {out}: File too large; choose another {arguments[-1]}\n"
    assert (status, *capsys.readouterr()) == (1, "", message)
    assert [path.read_text() for path in folder.iterdir()] == ["older"] * there


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    out = tmp_path / "scan.csv"
    out.write_text("older")
    with suppress(KeyboardInterrupt), atomic_file(out) as file:
        file.write(b"newer")
        file.flush()
        raise KeyboardInterrupt
    assert [path.read_text() for path in tmp_path.iterdir()] == ["older"]


def test_an_overwritten_file_keeps_its_permissions_and_links(tmp_path: Path) -> None:
    out, link = tmp_path / "scan.csv", tmp_path / "newest.csv"
    out.write_text("older")
    out.chmod(0o640)
    link.symlink_to(out)
    with text_output(str(link)) as file:
        file.write("newer")
    assert link.is_symlink()
    assert out.read_text() == "newer"
    assert out.stat().st_mode & 0o777 == 0o640


def test_a_new_file_has_default_permissions(tmp_path: Path) -> None:
    with text_output(str(tmp_path / "scan.csv")) as file:
        file.write("new")
    (tmp_path / "other").touch()
    assert (tmp_path / "scan.csv").stat().st_mode == (tmp_path / "other").stat().st_mode


def test_a_device_is_written_to_and_not_replaced(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["simulate", str(ROOM), "--place", "figure9", "--out"]
    assert run([*command, "/dev/full"]) == 1
    message = "sonarhw: /dev/full: No space left on device; delete other files or choose another --out\n"
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


@pytest.mark.parametrize(
    "arguments",
    [
        ["simulate", ROOM, "--place", "figure9"],
        ["paths", ROOM, "--place", "figure9"],
        ["log", "export", "scan.mcap", "--out", "-"],
    ],
    ids=["simulate", "paths", "export"],
)
@pytest.mark.parametrize(
    ("redirection", "message"),
    [
        (">&-", "standard output: is closed; leave it open, or name a file with --out"),
        (">/dev/full", "standard output: No space left on device; name a file with --out"),
    ],
)
@pytest.mark.parametrize("unbuffered", ["", "1"], ids=["buffered", "unbuffered"])
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
    command = shlex.join([sys.executable, "-c", "from sonarhw_cli.entry import main; main()", *map(str, arguments)])
    done = subprocess.run(
        f"{command} {redirection}", shell=True, cwd=tmp_path, stderr=subprocess.PIPE, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (1, f"sonarhw: {message}\n")


@pytest.mark.parametrize("given", ["{}", "fake:{}", "fake:{}?place=figure9&seed=1"])
def test_the_room_file_of_a_url_is_an_input_file(tmp_path: Path, given: str) -> None:
    room = tmp_path / "own.mcap"
    room.write_text("name = 'own'")
    with pytest.raises(InputError, match="is the input file"):
        checked_out(room, (LOG,), True, None, "paper", "socket://127.0.0.1:4000", given.format(room))


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
