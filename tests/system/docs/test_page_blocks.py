"""The shell and Python blocks of README and docs run as printed, and commands print what the page shows.

A normal run leaves out the pages in LONG, whose blocks take minutes; with `--soak` every page runs.

The blocks of a page run in order, in one folder that contains a copy of `rooms/`, `examples/` and
`docs/comparing/study_example.toml`.
Its Python blocks share their names. Commands that serve a scanner run until the end of the page.
"""

import re
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from tests.checkout import CHECKOUT
from tests.free_port import free_port
from tests.hang_guard import HANG
from tests.transcripts import PYTHON, SHELL, Block, Command, Shell, blocks_of

ELSEWHERE = {"figures.md"}  # `sonarhw figures` writes it, and test_figures_command.py runs its commands
PAGES = [
    page
    for page in [CHECKOUT / "README.md", *sorted((CHECKOUT / "docs").rglob("*.md"))]
    if page.name not in ELSEWHERE and blocks_of(page)
]
LONG = {"fit.md", "locate.md", "map.md", "python.md", "study.md", "track.md"}  # minutes; complete with --soak
NOT_CODE = ("text", "toml", "c")
# Units by which the last digit of a maximum differs between processors. The likelihood of a pose is rough: on another
# processor, the search ends at another step of it, up to 0.3 of the stated standard deviation away.
SEARCHES = {"sonarhw fit ": 5, "sonarhw locate ": 30}
DECIMAL = re.compile(r"-?\d+\.\d+")
SERVERS = ("sonarhw fake ", "sonarhw replay ")
PORT = "127.0.0.1:4000"  # of the pages; another test may use it, so each page gets a free one


class Reader:
    """Does what a page says, in a folder."""

    def __init__(self, folder: Path) -> None:
        self.names: dict[str, Any] = {"__name__": "__main__"}
        self._servers: list[subprocess.Popen[str]] = []
        self._shell = Shell(folder, apart=False)
        self._port = f"127.0.0.1:{free_port()}"

    def assert_runs(self, block: Block) -> None:
        """Run a block, and assert that it succeeds and prints what the page says."""
        for text in block.run_first:
            self._run(block, Command(text, ""))
        if block.info == PYTHON:
            exec(compile("\n" * _line(block) + block.text, block.where, "exec"), self.names)
        else:
            for command in block.commands():
                self._serve(block, command) if command.text.startswith(SERVERS) else self._run(block, command)

    def _run(self, block: Block, command: Command) -> None:
        text = self._own(command.text)
        done = self._shell.run(text)
        printed = done.stdout
        assert done.returncode == 0, f"{block.where}: {command.text}\n{printed}"
        if command.printed:
            expected = self._own(command.printed)
            units = next((most for search, most in SEARCHES.items() if text.startswith(search)), 0)
            assert alike(printed, expected, units), f"{block.where}: {command.text}\n{printed}expected:\n{expected}"

    def _serve(self, block: Block, command: Command) -> None:
        words = self._own(command.text).removesuffix("&")
        server = subprocess.Popen(
            ["bash", "-c", f"exec {words}"],
            stdout=subprocess.PIPE,
            text=True,
            cwd=self._shell.folder,
            env=self._shell.environment,
        )
        self._servers.append(server)
        url = server.stdout.readline()
        assert url, f"{block.where}: {command.text}"
        if command.printed:
            assert url == self._own(command.printed), f"{block.where}: {command.text}"

    def _own(self, text: str) -> str:
        return text.replace(PORT, self._port)

    def leave(self) -> None:
        """Stop the servers."""
        for server in self._servers:
            with server:
                with suppress(ProcessLookupError):
                    server.send_signal(signal.SIGINT)
                server.wait(timeout=HANG)


def alike(one: str, other: str, units: int) -> bool:
    """Return whether two texts are equal but for up to some units in the last digit of decimal numbers."""
    if not units:
        return one == other
    numbers, others = DECIMAL.findall(one), DECIMAL.findall(other)
    if DECIMAL.sub("0.0", one) != DECIMAL.sub("0.0", other):
        return False
    return all(
        abs(float(a) - float(b)) <= (units + 0.01) * 10.0 ** -len(b.partition(".")[2])
        for a, b in zip(numbers, others, strict=True)
    )


def test_only_the_last_digit_of_a_search_may_differ() -> None:
    assert alike("at 2.8997 m, 85% of 72\n", "at 2.8994 m, 85% of 72\n", 5)
    assert not alike("at 2.8997 m\n", "at 2.8987 m\n", 5)
    assert not alike("at 2.8997 m\n", "at 2.8996 m\n", 0)
    assert not alike("85%\n", "86%\n", 5)


def _line(block: Block) -> int:
    """Return the line of the page at which a block begins, for tracebacks."""
    return int(block.where.rpartition(" ")[2])


@pytest.fixture
def reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Reader]:
    for folder in ("rooms", "examples"):
        shutil.copytree(CHECKOUT / folder, tmp_path / folder)
    (tmp_path / "docs" / "comparing").mkdir(parents=True)
    shutil.copy(CHECKOUT / "docs" / "comparing" / "study_example.toml", tmp_path / "docs" / "comparing")
    monkeypatch.chdir(tmp_path)
    reader = Reader(tmp_path)
    yield reader
    reader.leave()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_blocks_of_a_page_run_as_printed(page: Path, reader: Reader, request: pytest.FixtureRequest) -> None:
    if page.name in LONG and not request.config.getoption("--soak"):
        pytest.skip("takes minutes; runs with --soak")
    for block in blocks_of(page):
        if block.not_run is None and block.info in (SHELL, PYTHON):
            reader.assert_runs(block)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_block_is_code_or_text_and_is_left_out_only_with_a_reason(page: Path) -> None:
    for block in blocks_of(page):
        assert block.info in (SHELL, PYTHON, *NOT_CODE), f"{block.where}: unknown info string {block.info!r}"
        if block.not_run is not None:
            assert len(block.not_run.split()) > 2, f"{block.where}: give the reason"
        elif block.info == SHELL:
            assert block.commands()


def test_pages_contain_no_block_in_another_form() -> None:
    for page in PAGES:
        fences = re.findall(r"^ *(```|~~~)", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
        assert len(fences) == 2 * len(blocks_of(page)), page.name


@pytest.mark.parametrize(
    ("text", "reason"), [("$ sonarhw simulate nowhere\n", "unknown room"), ("$ echo right\nwrong\n", "right")]
)
def test_a_command_that_fails_or_prints_something_else_is_found(text: str, reason: str, reader: Reader) -> None:
    with pytest.raises(AssertionError, match=reason):
        reader.assert_runs(Block("page, line 1", SHELL, text, (), None))
