from .fitting import fit_scans
from .plain_fit import Fit, fit_scan
from .values.fit_result import Estimate, FitOptions, FitResult, Mode, PlacedScan
from .values.parameters import Parameter, free_parameters
from .values.quantities import QUANTITIES, Quantity
from .values.warning_kinds import (
    AtBound,
    FewExplained,
    KnownTogether,
    ManyStrays,
    Mismatch,
    SeveralSolutions,
    Unconstrained,
    Underestimated,
)

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
