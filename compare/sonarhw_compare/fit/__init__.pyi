from .fitting import fit_scans
from .parameters import Parameter, free_parameters
from .quantities import QUANTITIES, Quantity
from .result import (
    AtBound,
    Estimate,
    FewExplained,
    FitOptions,
    FitResult,
    KnownTogether,
    ManyStrays,
    Mismatch,
    Mode,
    PlacedScan,
    SeveralSolutions,
    Unconstrained,
    Underestimated,
)
from .starting import Fit, fit_scan

__all__ = [
    "QUANTITIES",
    "AtBound",
    "Estimate",
    "FewExplained",
    "Fit",
    "FitOptions",
    "FitResult",
    "KnownTogether",
    "ManyStrays",
    "Mismatch",
    "Mode",
    "Parameter",
    "PlacedScan",
    "Quantity",
    "SeveralSolutions",
    "Unconstrained",
    "Underestimated",
    "fit_scan",
    "fit_scans",
    "free_parameters",
]
