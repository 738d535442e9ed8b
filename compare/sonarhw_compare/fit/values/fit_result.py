"""What goes into a fit and what comes out of it: plain frozen values, no Qt and no printing."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.model import Place, Room

from sonarhw.readings import FloatArray, Reading
from sonarhw_compare.fit.values.parameters import Parameter
from sonarhw_compare.matching.match import Summary

Progress = Callable[[float, str], None]  # share that is done, 0..1, and what is being done


@dataclass(frozen=True)
class PlacedScan:
    """A measured scan and the place where it is believed to have been taken."""

    readings: Sequence[Reading]
    place: Place
    name: str = ""


@dataclass(frozen=True)
class FitOptions:
    """How to fit."""

    prediction: PredictionOptions = field(default_factory=PredictionOptions)
    seed: int = 0  # of the sampler that finds the uncertainties; same seed, same result
    samples: int = 8000  # from the posterior, some 300 of them independent; 0: curvature tells it
    all_echoes: bool = True  # False: only the first echo of each reading
    global_search: bool = True  # False: begin where places, room and board say


@dataclass(frozen=True)
class Estimate:
    """One fitted number, in the unit of its parameter (rad for a heading)."""

    value: float
    deviation: float  # standard deviation
    lower: float  # of the region that holds the truth with 95 %
    upper: float


@dataclass(frozen=True)
class Mode:
    """One of several answers between which the data hardly tell."""

    values: dict[str, float]  # by parameter name
    score: float  # log-likelihood and prior, natural logarithm, relative to the best


@dataclass(frozen=True)
class FitResult:
    """What explains the scans best."""

    parameters: tuple[Parameter, ...]
    estimates: dict[str, Estimate]  # by parameter name, in the order of `parameters`
    correlations: FloatArray  # (p, p), in that order
    noise: dict[str, float]  # of the readings, found along the way: range_m, level_db, missed, stray_per_m
    warnings: tuple[str, ...]
    modes: tuple[Mode, ...]  # the best first
    room: Room  # as fitted, and so
    places: tuple[Place, ...]  # one for each scan
    board: Board
    score: float  # log-likelihood and prior at the best, natural logarithm
    samples: FloatArray  # (m, p): drawn from the posterior; m may be 0
    agreement: tuple[Summary, ...] = ()  # of each scan over the prediction from what was found
