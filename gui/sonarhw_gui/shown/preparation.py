"""Progress of the compilation of kernels at the first start, for the status bar."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Compiled:
    """How many kernels are compiled; a prediction does not need all `known` ones."""

    done: int
    known: int


class Preparation:
    """Receives reports from the threads that compile. Implements `sonarhw_sim.compiled.Watcher`."""

    def __init__(self) -> None:
        self.progress: Compiled | None = None  # None while nothing is compiled
        self.messages: list[str] = []

    def compiling(self, done: int, known: int) -> None:
        """Note the progress."""
        self.progress = Compiled(done, known)

    def compiled(self) -> None:
        """Note that compilation has ended for now."""
        self.progress = None

    def not_stored(self, reason: str) -> None:
        """Note that the next start compiles again."""
        self.messages.append(reason)
