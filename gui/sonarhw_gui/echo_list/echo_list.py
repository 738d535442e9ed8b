"""The texts of the list of echoes at one heading, without widgets."""

from dataclasses import dataclass
from functools import cached_property

from sonarhw_compare.explain import RankedEcho, outcome_text, ranked_echoes, remedy, remedy_text, runner_up
from sonarhw_compare.scans import heading_text
from sonarhw_sim.predict.predicted_scan import PredictedScan

from sonarhw_gui.look.appearance import LengthUnit

COLUMNS = ("½ path", "level", "what becomes of it", "path")


@dataclass(frozen=True)
class EchoList:
    """All echoes at one heading of a prediction, ranked."""

    prediction: PredictedScan
    index: int
    unit: LengthUnit

    @cached_property
    def found(self) -> tuple[RankedEcho, ...]:
        """The echoes, that of the winner first."""
        return ranked_echoes(self.prediction, self.index)

    def cells(self, row: int) -> tuple[str, ...]:
        """Return the texts of one row, one for each of `COLUMNS`."""
        echo = self.found[row]
        via = ">".join(self.prediction.paths.via(echo.path, self.prediction.room))
        level = f"{echo.level_db:.1f} dB".replace("-", "−")
        return self.unit.text(echo.half), level, outcome_text(echo, self.unit.text), via

    def is_out(self, row: int) -> bool:
        """Return whether the board cannot detect an echo: it is blanked or too weak."""
        return (self.found[row].blanked or self.found[row].too_weak) and not self.found[row].wins

    def note(self, row: int | None) -> str:
        """Return what would let the echo in a row win; without a row, or for the winner, the runner-up."""
        if row is not None and not self.found[row].wins:
            return self._would_win(self.found[row], "this echo")
        best = runner_up(self.found)
        if best is None:
            return "no other echo within 20 dB of the threshold"
        return self._would_win(best, "the runner-up")

    @property
    def title(self) -> str:
        """The heading and the number of echoes."""
        count = len(self.found)
        return f"{heading_text(float(self.prediction.headings[self.index]))} · {count} echo{'es' * (count != 1)}"

    def _would_win(self, echo: RankedEcho, name: str) -> str:
        how = remedy_text(remedy(self.prediction, self.index, echo), self.unit.text)
        if not how:
            return f"{name} ({self.unit.text(echo.half)}): no small change lets it win"
        return f"{name} ({self.unit.text(echo.half)}) would win with {how}"
