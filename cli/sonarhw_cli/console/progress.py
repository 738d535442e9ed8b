"""The progress bar of long work, shown only if standard error is a terminal, and not with --quiet.

Elsewhere, a line announces a compilation: it takes up to a minute, and a program must not seem to hang.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from sonarhw.errors import harmless
from sonarhw_cli.console.lines import Verbosity, print_note, prints, warn

if TYPE_CHECKING:
    from rich.progress import Progress

_PARTS = 100  # of a bar that shows a share
_COMPILING = "Compiling the ray kernels, once per installation…"
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


class CompilationProgress:
    """Shows a progress bar while kernels are compiled; a single line if standard error is not a terminal."""

    def __init__(self) -> None:
        self._announced = False
        self._bar = ExitStack()
        self._show: Callable[[int], None] | None = None

    def compiling(self, done: int, known: int) -> None:
        """Show the bar, or print the line at the first call."""
        if not (self._announced or sys.stderr.isatty()):
            self._announced = True
            print_note(f"sonarhw: {_COMPILING}")
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
    if _shown or not (sys.stderr.isatty() and prints(Verbosity.NORMAL)):
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
