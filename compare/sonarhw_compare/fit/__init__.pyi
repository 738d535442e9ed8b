from .fitting import fit_scans
from .plain_fit import Fit, fit_scan
from .values.fit_result import Estimate, FitOptions, FitResult, Mismatch, Mode, PlacedScan
from .values.parameters import Parameter, free_parameters
from .values.quantities import QUANTITIES, Quantity

__all__ = [
    "QUANTITIES",
    "Estimate",
    "Fit",
    "FitOptions",
    "FitResult",
    "Mismatch",
    "Mode",
    "Parameter",
    "PlacedScan",
    "Quantity",
    "fit_scan",
    "fit_scans",
    "free_parameters",
]
