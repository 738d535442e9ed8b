"""Files that commands write: completely or not at all. The transcript `output_names.md` has the refused names."""

import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from sonarhw_cli.outputs import atomic_file, text_output

from tests.fixtures.commands import printed, sonarhw
from tests.fixtures.example_logs import write_example


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
def test_a_full_disk_leaves_no_incomplete_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
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


def test_a_command_that_prints_nothing_needs_no_standard_output(tmp_path: Path) -> None:
    write_example(tmp_path / "scan.mcap", 4)
    streams = "import os; print(sorted(int(n) for n in os.listdir('/proc/self/fd'))[:3], file=open('streams', 'w'))"
    main = f"from sonarhw_cli import entry; entry._occupy_closed_streams(); {streams}; entry.main()"
    command = shlex.join([sys.executable, "-c", main, "log", "export", "scan.mcap", "--out", "scan.csv"])
    subprocess.run(f"{command} <&- >&- 2>&-", shell=True, cwd=tmp_path, check=True)
    assert (tmp_path / "scan.csv").read_text().startswith("time_s,")
    # no file of the command has the number of a standard stream
    assert (tmp_path / "streams").read_text() == "[0, 1, 2]\n"
