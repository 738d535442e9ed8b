"""Input and result of a fit, as frozen values."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import Place, Room

from sonarhw.readings import FloatArray, Reading
from sonarhw_compare.fit.values.parameters import Parameter
from sonarhw_compare.fit.values.quantities import ROOM_TOLERANCE
from sonarhw_compare.fit.values.warning_kinds import FitWarning, Mismatch
from sonarhw_compare.matching.match import Summary

Progress = Callable[[float, str], None]  # completed share, 0..1, and name of the present step


@dataclass(frozen=True)
class PlacedScan:
    """A measured scan and its assumed place."""

    readings: Sequence[Reading]
    place: Place
    name: str = ""  # in the names of its parameters, and of its place in a fitted room
    file: str = ""  # its log

    @property
    def title(self) -> str:
        """The log of the scan, or else its name, for messages."""
        return self.file or self.name


@dataclass(frozen=True)
class FitOptions:
    """Settings of a fit."""

    prediction: PredictionOptions = field(default_factory=PredictionOptions)
    seed: int = 0  # of the sampler; the same seed gives the same result
    samples: int = 8000  # from the posterior, about 300 of them independent; 0: intervals from the curvature
    all_echoes: bool = True  # False: use the first echo of each reading only
    global_search: bool = True  # False: start at the given places, room and board
    room_tolerance: float = ROOM_TOLERANCE  # m, standard deviation of the position of each wall that is not free
    exact: bool = False  # True: all that is not free is exact: walls, reflectances, threshold, aperture, turntable


@dataclass(frozen=True)
class Estimate:
    """One fitted number, in the unit of its parameter (rad for a heading)."""

    value: float
    deviation: float  # standard deviation
    lower: float  # of the 95 % credible interval
    upper: float


@dataclass(frozen=True)
class Mode:
    """One of several solutions that explain the data about equally well."""

    values: dict[str, float]  # by parameter name
    score: float  # log-likelihood and prior, natural logarithm, relative to the best


@dataclass(frozen=True)
class FitResult:
    """The result of a fit."""

    parameters: tuple[Parameter, ...]
    estimates: dict[str, Estimate]  # by parameter name, in the order of `parameters`
    correlations: FloatArray  # (p, p), in that order
    noise: dict[str, float]  # fitted errors of the readings: range_m, level_db, missed, lost, stray_per_m, stretch
    warnings: tuple[FitWarning, ...]  # the most important first
    modes: tuple[Mode, ...]  # the best first
    room: Room  # fitted
    places: tuple[Place, ...]  # fitted, one for each scan
    board: Board  # fitted
    score: float  # log-likelihood and prior of the best solution, natural logarithm
    samples: FloatArray  # (m, p), from the posterior; m may be 0
    agreement: tuple[Summary, ...] = ()  # of each scan with the fitted prediction
    tolerated: dict[str, Estimate] = field(default_factory=dict)  # by name, of values neither free nor exact
    mismatches: tuple[Mismatch, ...] = ()  # clearest first
