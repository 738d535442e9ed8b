"""The progress bar of long work: on a terminal there is one, in a pipe none."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_PARTS = 100  # of the bar of what tells its share


@contextmanager
def progress(total: int, doing: Callable[[], str]) -> Iterator[Callable[[], None]]:
    """What is to be called `total` times, once for each part that is done; `doing` says in a word what goes on."""
    if not sys.stderr.isatty():
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
    from rich.text import Text

    class Doing(ProgressColumn):
        """Asked anew each time the bar is drawn."""

        def render(self, task: Task) -> Text:
            return Text(doing())

    columns = (Doing(), BarColumn(), TextColumn("{task.completed:g}/{task.total:g}"), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=total)
        yield lambda: bar.advance(task)


@contextmanager
def progress_of_share() -> Iterator[Callable[[float, str], None]]:
    """What is to be called with the share that is done, 0 to 1, and in a word what goes on."""
    now, done = "", 0
    with progress(_PARTS, lambda: now) as tick:

        def show(share: float, doing: str) -> None:
            nonlocal now, done
            now = doing
            while done < int(share * _PARTS):
                tick()
                done += 1

        yield show
