"""Adapts bounces, rays and receiver of draft predictions, so that drafts keep up with a dragged sensor."""

from dataclasses import dataclass, replace

from sonarhw_sim.air import Receiver
from sonarhw_sim.predict.prediction import PredictionOptions

_TOO_LONG, _SHORT = 0.020, 0.005  # s, duration of a draft


@dataclass(frozen=True)
class Effort:
    """Limits of a draft prediction."""

    max_bounces: int
    rays: int
    headings: int  # number of headings, used if every heading needs its own search
    ideal: bool = True  # whether to use the ideal receiver, which takes half of the time of that of the board

    def limit(self, options: PredictionOptions) -> PredictionOptions:
        """Return the options limited to this effort."""
        return replace(
            options,
            max_bounces=min(options.max_bounces, self.max_bounces),
            rays=min(options.rays, self.rays),
            receiver=Receiver.FIRST_ECHO if self.ideal else options.receiver,
        )


_EFFORTS = (
    Effort(1, 720, 24),
    Effort(2, 720, 36),
    Effort(3, 1440, 72),
    Effort(4, 1440, 120),
    Effort(6, 2880, 180),
    Effort(8, 2880, 360, ideal=False),
)
_FIRST = 3


class EffortChoice:
    """Raises the effort while drafts are fast, and lowers it after a slow one."""

    def __init__(self) -> None:
        self._level = _FIRST

    @property
    def effort(self) -> Effort:
        """Limits of the next draft."""
        return _EFFORTS[self._level]

    def record(self, seconds: float) -> None:
        """Adapt the effort to the duration of the last draft."""
        if seconds > _TOO_LONG:
            self._level = max(0, self._level - 1)
        elif seconds < _SHORT:
            self._level = min(len(_EFFORTS) - 1, self._level + 1)
