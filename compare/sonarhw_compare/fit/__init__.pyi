from .fitting import fit_scans
from .parameters import Parameter, free_parameters
from .quantities import QUANTITIES, Quantity
from .result import (
    Estimate,
    FitOptions,
    FitResult,
    FitWarning,
    Mismatch,
    Mode,
    PlacedScan,
)
from .starting import Fit, fit_scan

__all__ = [
    "QUANTITIES",
    "Estimate",
    "Fit",
    "FitOptions",
    "FitResult",
    "FitWarning",
    "Mismatch",
    "Mode",
    "Parameter",
    "PlacedScan",
    "Quantity",
    "fit_scan",
    "fit_scans",
    "free_parameters",
]
