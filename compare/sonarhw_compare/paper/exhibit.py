"""An exhibit: one figure of the paper, drawn again, with the claims of its text.

A claim is checked by a function of scenes; the scenes of the figure are its defaults. It returns what the model shows
and whether the claim holds. With other scenes (another unit, another place) the claim can fail, which the tests check.
"""

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from sonarhw_compare.paper.setting import PaperScene


@dataclass(frozen=True)
class Claim:
    """A statement of the paper, what the model shows, and whether they agree."""

    says: str
    measured: str
    holds: bool


@dataclass(frozen=True)
class Exhibit:
    """A figure of the paper."""

    name: str  # of its picture, without the suffix
    title: str
    setting: str  # the setup, and which parts of it are from the paper
    scenes: tuple[PaperScene, ...]  # the scans in the picture
    draw: Callable[[], Figure]
    claims: tuple[Callable[[], Claim], ...]
