"""Output of the commands: standard output, progress, and files that are written completely or not at all."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from io import StringIO, TextIOBase
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, BinaryIO, TextIO
from urllib.parse import parse_qsl

import typer
from sonarhw_sim.compilation import Watcher

from sonarhw.errors import InputError, OutputError, harmless
from sonarhw.files import atomic_file, is_special
from sonarhw_cli.options import NORMAL, STDOUT, print_note, prints, warn

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.progress import Progress

# Output of the commands: standard output, and files that are written completely or not at all.
#
# `checked_out` checks a file name before the work begins. Logs are not written here: they grow on disk reading by
# reading, and are readable after any interruption.


@contextmanager
def written_file(path: Path, what: str = "file", *, overwrite: bool) -> Iterator[BinaryIO]:
    """Yield the file `path`, kept only if the block succeeds, and print its name then. Raises OutputError."""
    with atomic_file(path, what, overwrite=overwrite) as file:
        yield file
    print_written(path)


def write_text(out: Path, text: str, force: bool, what: str = "file") -> None:
    """Write a text file. Raises OutputError. A file name in the text that is no Unicode has question marks."""
    with written_file(out, what, overwrite=force) as file:
        file.write(text.encode(errors="replace"))


def write_figure(out: Path, figure: "Figure", force: bool) -> None:
    """Write a picture in the format of the file's suffix; PNG for a device or a pipe. Raises OutputError."""
    from sonarhw_compare.picture_file import PICTURES, write_picture

    with written_file(out, overwrite=force) as file:
        write_picture(figure, file, PICTURES[0] if is_special(out) else out.suffix.lower())


def print_written(path: Path) -> None:
    """Print that a file is written, on standard error; nothing for a device or a pipe, and with --quiet."""
    if not is_special(path):
        print_note(f"{path}: written")


@contextmanager
def text_output(out: str, overwrite: bool) -> Iterator[TextIO]:
    """Yield standard output for `-`, else a buffer that is written to the file `out` if the block succeeds.

    Raises OutputError.
    """
    if out == STDOUT:
        with _flushed(standard_output()) as text:
            yield text
        return
    text = StringIO(newline="")
    yield text
    write_text(Path(out), text.getvalue(), overwrite)


@contextmanager
def binary_output(out: str, overwrite: bool) -> Iterator[BinaryIO]:
    """Yield standard output for `-`, else the file `out`, kept only if the block succeeds. Raises OutputError."""
    if out != STDOUT:
        with written_file(Path(out), overwrite=overwrite) as file:
            yield file
        return
    with _flushed(standard_output()) as text:
        yield text.buffer


class ClosedOutput(TextIOBase):
    """Standard output that was closed before the command started. Writing raises OutputError."""

    def write(self, text: str) -> int:
        """Raise OutputError, unless the text is empty."""
        if text:
            raise OutputError("standard output: is closed; leave it open, or redirect it to a file")
        return 0


def standard_output() -> TextIO:
    """Return standard output. Raises OutputError if it was closed before the command started."""
    if sys.stdout is None or isinstance(sys.stdout, ClosedOutput):
        raise OutputError("standard output: is closed; leave it open, or name a file with --out")
    return sys.stdout


@contextmanager
def _flushed(text: TextIO) -> Iterator[TextIO]:
    try:
        yield text
        text.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputError(f"standard output: {error.strerror or error}; name a file with --out") from error


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """Create a folder for several files if it is missing, and remove it again if the block fails and it is empty.

    Raises InputError.
    """
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        # within `try`: Ctrl-C may come as soon as the folder exists
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder}: cannot be created: {error.strerror}; give another folder") from error
        yield
    except BaseException:
        for path in made:
            with suppress(OSError):
                path.rmdir()
        raise


def checked_out(
    out: str | Path, suffixes: Sequence[str], force: bool, *inputs: str | Path | None, option: str = "--out"
) -> str:
    """Return the suffix of the name `out`, one of `suffixes`. If `-` is one of them, it means standard output.

    Returns the first suffix for a device or a pipe. Raises InputError if the name has another suffix, is a folder, an
    existing file (without `force`) or one of the `inputs`, or if its folder does not exist.
    """
    if str(out) == STDOUT and STDOUT in suffixes:
        _refuse_overwriting(Path("/dev/stdout"), *inputs, option=option)
        return STDOUT
    path = Path(out)
    if is_special(path):
        _refuse_overwriting(path, *inputs, option=option)
        return suffixes[0]
    suffix = path.suffix.lower()
    if suffix not in suffixes:
        *others, last = [name for name in suffixes if name != STDOUT]
        wanted = f"{', '.join(others)} or {last}" if others else last
        stdout = f", or {STDOUT} for standard output" if STDOUT in suffixes else ""
        raise InputError(f"{option} {out}: expected a name ending in {wanted}{stdout}")
    _refuse_existing(path, force, option)
    _refuse_overwriting(path, *inputs, option=option)
    return suffix


def _refuse_existing(path: Path, force: bool, option: str) -> None:
    """Raise InputError if `path` exists and may not be overwritten, or if its folder is missing."""
    if path.is_dir():
        raise InputError(f"{option} {path}: is a folder; give the name of a file in it")
    if path.exists() and not force:
        raise InputError(f"{path}: exists already; choose another {option} or add --force")
    if not path.parent.is_dir():
        raise InputError(f"{path}: no such folder: {path.parent}; create it first")


def refuse_existing_in(folder: Path, files: Sequence[Path], force: bool, option: str) -> None:
    """Raise InputError if `folder` is a file, or if one of its `files` exists and may not be overwritten."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; give the name of a folder")
    for file in files if folder.exists() else ():
        _refuse_existing(file, force, option)


def _refuse_overwriting(out: Path, *inputs: str | Path | None, option: str) -> None:
    """Raise InputError if `out` is one of the files that the command reads, perhaps under another name.

    Inputs that are not files are ignored: None, URLs, and names of shipped rooms and boards.
    """
    for given in inputs:
        for read in _files_read("" if given is None else str(given)):
            # these functions return False where a Path raises, for example for a folder that may not be read
            if os.path.isfile(read) and os.path.exists(out) and os.path.samefile(out, read):
                raise InputError(f"{option} {out}: is the input file {read}; choose another name")


def _files_read(given: str) -> list[Path]:
    """Return the files that an argument may name: itself, or room and board of `fake:ROOM?board=FILE`."""
    if not given.startswith("fake:"):
        return [Path(given)] if given else []
    room, _, query = given.removeprefix("fake:").partition("?")
    return [Path(room), *(Path(value) for key, value in parse_qsl(query) if key == "board")]


# The progress bar of long work, shown only if standard error is a terminal, and not with --quiet.
#
# Elsewhere, a line announces a compilation: it takes up to a minute, and a program must not seem to hang.


_PARTS = 100  # of a bar that shows a share
_COMPILING = "Compiling the ray kernels, once per installation…"
_KERNELS_A_LINE = 20
_shown: list["Progress"] = []  # at most one bar: a second one would be drawn over it
_interjections: list[str] = []  # shown instead of the word for the work in progress


@contextmanager
def progress(total: int, doing: Callable[[], str]) -> Iterator[Callable[[], None]]:
    """Yield a function to call once for each of `total` parts; `doing` returns a word for the work in progress."""
    with _bar(total, doing) as bar:
        yield lambda: bar.advance(bar.task_ids[0]) if bar else None


@contextmanager
def _interjected(total: int, text: str) -> Iterator[Callable[[int], None]]:
    """Yield a function to call with the number of completed parts of other work that the work in progress waits for.

    If a bar is shown already, `text` replaces its word, and no second bar is shown.
    """
    _interjections.append(text)
    try:
        with _bar(total, lambda: text) as bar:
            yield lambda done: bar.update(bar.task_ids[0], completed=done) if bar else None
    finally:
        _interjections.remove(text)


@contextmanager
def progress_of_share() -> Iterator[Callable[[float, str], None]]:
    """Yield a function to call with the completed share, 0 to 1, and a word for the work in progress."""
    now = ""
    with _bar(_PARTS, lambda: now) as bar:

        def show(share: float, doing: str) -> None:
            nonlocal now
            changed, now = doing != now, doing
            if bar:
                # a new word is drawn at once: short work might end before the next regular drawing
                bar.update(bar.task_ids[0], completed=int(share * _PARTS), refresh=changed)

        yield show


@contextmanager
def progress_of_fit(fit: str) -> Iterator[Callable[[float], None]]:
    """Yield a function to call with the completed share of the fit that --fit names; no bar is shown without --fit."""
    if not fit:
        yield lambda _share: None
        return
    with progress_of_share() as show:
        yield lambda share: show(share, "fitting")


class CompilationProgress(Watcher):
    """Shows a progress bar while kernels are compiled; lines if standard error is not a terminal."""

    def __init__(self) -> None:
        self._next_line = 0  # number of compiled kernels
        self._bar = ExitStack()
        self._show: Callable[[int], None] | None = None

    def compiling(self, done: int, known: int) -> None:
        """Show the bar, or print a line at the first call and each time that many more kernels are compiled."""
        if not sys.stderr.isatty() and done >= self._next_line:
            print_note(f"sonarhw: {_COMPILING} {f'{done} of {known}' if self._next_line else ''}")
            self._next_line = done + _KERNELS_A_LINE
        if self._show is None:
            self._show = self._bar.enter_context(_interjected(known, _COMPILING))
        self._show(done)

    def compiled(self) -> None:
        """Remove the bar."""
        self._bar.close()
        self._show = None

    def not_stored(self, reason: str) -> None:
        """Print a warning."""
        warn(reason)


@contextmanager
def _bar(total: int, doing: Callable[[], str]) -> Iterator["Progress | None"]:
    if _shown or not (sys.stderr.isatty() and prints(NORMAL)):
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
    from rich.table import Column
    from rich.text import Text

    class Doing(ProgressColumn):
        """The word for the work in progress, updated each time the bar is drawn."""

        def render(self, task: Task) -> Text:
            return Text(harmless(_interjections[-1] if _interjections else doing()))

    word = Doing(table_column=Column(no_wrap=True))
    columns = (word, BarColumn(None), TextColumn("{task.completed:g}/{task.total:g}"), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True, expand=True) as bar:
        bar.add_task("", total=total)
        _shown.append(bar)
        try:
            yield bar
        finally:
            _shown.remove(bar)


# New room files and board profiles from a template.


NewFile = Annotated[Path, typer.Argument(help="File to create.", metavar="NAME.toml")]


def write_template(package: str, file: Path) -> None:
    """Write the template of a package to a new file. Raises InputError if it exists or has another suffix."""
    from importlib.resources import files

    if file.suffix != ".toml":
        raise InputError(f"{file}: expected a name ending in .toml")
    if file.exists() or file.is_symlink():
        raise InputError(f"{file}: exists already; choose another name")
    if not file.parent.is_dir():
        raise InputError(f"{file}: no such folder: {file.parent}; create it first")
    with atomic_file(file) as out:
        out.write((files(package) / "template.toml").read_bytes())
