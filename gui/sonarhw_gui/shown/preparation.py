"""Progress of the compilation of kernels at the first start, as text for the status bar."""


class Preparation:
    """Receives reports from the threads that compile. Implements `sonarhw_sim.compilation.Watcher`."""

    def __init__(self) -> None:
        self.text = ""  # empty while nothing is compiled
        self.messages: list[str] = []

    def compiling(self, done: int, known: int) -> None:
        """Note how many of the `known` kernels are compiled; a prediction does not need all of them."""
        self.text = f"preparing the model (first start only): {done} of at most {known} parts"

    def compiled(self) -> None:
        """Note that compilation has ended for now."""
        self.text = ""

    def not_stored(self, reason: str) -> None:
        """Note that the next start compiles again."""
        self.messages.append(reason)
