"""The progress bar of long work, shown only if standard error is a terminal."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_PARTS = 100  # of a bar that shows a share


@contextmanager
def progress(total: int, doing: Callable[[], str]) -> Iterator[Callable[[], None]]:
    """Yield a function to call once for each of `total` parts; `doing` returns a word for the work in progress."""
    if not sys.stderr.isatty():
        yield lambda: None
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
        task = bar.add_task("", total=total)
        yield lambda: bar.advance(task)


@contextmanager
def progress_of_share() -> Iterator[Callable[[float, str], None]]:
    """Yield a function to call with the completed share, 0 to 1, and a word for the work in progress."""
    now, done = "", 0
    with progress(_PARTS, lambda: now) as tick:

        def show(share: float, doing: str) -> None:
            nonlocal now, done
            now = doing
            while done < int(share * _PARTS):
                tick()
                done += 1

        yield show
