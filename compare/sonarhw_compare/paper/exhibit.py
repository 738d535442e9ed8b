"""An exhibit: one figure of the paper, drawn again, and the claims that its text makes.

A claim is a function of the scenes it speaks of, with the figure's own as defaults; what it returns says what was
measured and whether the claim holds. Given another scene (another unit, another place) it can fail.
"""

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from sonarhw_compare.paper.setting import PaperScene


@dataclass(frozen=True)
class Claim:
    """What the paper says should be seen, and whether it is."""

    says: str
    measured: str
    holds: bool


@dataclass(frozen=True)
class Exhibit:
    """A figure of the paper."""

    name: str  # of its picture, without the ending
    title: str
    setting: str  # what of it is the paper's and what is ours
    scenes: tuple[PaperScene, ...]  # the scans in the picture
    draw: Callable[[], Figure]
    claims: tuple[Callable[[], Claim], ...]
