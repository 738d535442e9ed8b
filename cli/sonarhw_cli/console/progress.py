"""The progress bar of long work, shown only if standard error is a terminal."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress

_PARTS = 100  # of a bar that shows a share


@contextmanager
def progress(total: int, doing: Callable[[], str]) -> Iterator[Callable[[], None]]:
    """Yield a function to call once for each of `total` parts; `doing` returns a word for the work in progress."""
    with _bar(total, doing) as bar:
        yield lambda: bar.advance(bar.task_ids[0]) if bar else None


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
def _bar(total: int, doing: Callable[[], str]) -> Iterator["Progress | None"]:
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
    from rich.text import Text

    class Doing(ProgressColumn):
        """The word for the work in progress, updated each time the bar is drawn."""

        def render(self, task: Task) -> Text:
            return Text(doing())

    columns = (Doing(), BarColumn(), TextColumn("{task.completed:g}/{task.total:g}"), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        bar.add_task("", total=total)
        yield bar
