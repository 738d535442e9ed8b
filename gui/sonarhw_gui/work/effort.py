"""How many bounces and rays a draft of the prediction uses, so that drafts keep up with a dragged sensor."""

from dataclasses import dataclass, replace

from sonarhw_sim.choices import Receiver
from sonarhw_sim.predict.prediction import PredictionOptions

_TOO_LONG, _SHORT = 0.020, 0.005  # s, of a draft


@dataclass(frozen=True)
class Effort:
    """What a draft may cost."""

    max_bounces: int
    rays: int
    headings: int  # where every heading needs a search of its own

    def limit(self, options: PredictionOptions) -> PredictionOptions:
        """Those options with no more than this effort; the paper's receiver, for the board's own listens to signals."""
        return replace(
            options,
            max_bounces=min(options.max_bounces, self.max_bounces),
            rays=min(options.rays, self.rays),
            receiver=Receiver.FIRST_ECHO,
        )


_EFFORTS = (
    Effort(1, 720, 24),
    Effort(2, 720, 36),
    Effort(3, 1440, 72),
    Effort(4, 1440, 120),
    Effort(6, 2880, 180),
    Effort(8, 2880, 360),
)
_FIRST = 3


class EffortChoice:
    """Goes deeper while drafts are quick, less deep when one was slow."""

    def __init__(self) -> None:
        self._level = _FIRST

    @property
    def effort(self) -> Effort:
        """What the next draft may cost."""
        return _EFFORTS[self._level]

    def took(self, seconds: float) -> None:
        """The last draft took that long."""
        if seconds > _TOO_LONG:
            self._level = max(0, self._level - 1)
        elif seconds < _SHORT:
            self._level = min(len(_EFFORTS) - 1, self._level + 1)
