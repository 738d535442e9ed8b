"""Which readings speak for and against each wall and post of a draft."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.echo_likelihood import ReadingNoise
from sonarhw_compare.room_finding.draft import RoomDraft, post_name, wall_name
from sonarhw_compare.room_finding.evidence import Evidence

_CLEARLY = 1.0  # change of the log-likelihood of a reading that clearly speaks for or against a wall


@dataclass(frozen=True, eq=False)
class Support:
    """The readings that speak for and against one wall or post."""

    name: str  # in the room of the draft
    gains: tuple[FloatArray, ...]  # log-likelihood of each reading with it minus without it, (n,) for each scan

    def speaking(self, sign: int) -> tuple[NDArray[np.bool_], ...]:
        """Return which readings clearly speak for it (1) or against it (-1), (n,) for each scan."""
        return tuple(sign * gains > _CLEARLY for gains in self.gains)


def support_of(evidence: Evidence, draft: RoomDraft, noise: ReadingNoise) -> tuple[Support, ...]:
    """Return the support of each wall and post of a draft, in the order of its room."""
    without = [(wall_name(number), draft.without_only(key)) for number, key in enumerate(draft.walls)]
    for number in range(len(draft.posts)):
        kept = draft.posts[:number] + draft.posts[number + 1 :]
        without.append((post_name(number), replace(draft, posts=kept)))
    whole = evidence.by_reading(draft, noise)
    supports = []
    for name, rest in without:
        less = evidence.by_reading(rest, noise)
        supports.append(Support(name, tuple(one - other for one, other in zip(whole, less, strict=True))))
    return tuple(supports)
