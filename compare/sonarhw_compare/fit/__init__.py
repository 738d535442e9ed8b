"""Fit: where the sensor stood and what room and board must be for scans to come out as they were measured.

Takes scans, a room, a board and what is free; hands on a `FitResult`. Files: `parameters` says what may be free and
what it changes, `echo_paths` how paths move with it, `likelihood` how well paths explain readings, `search` where to
begin, `refine` how to get to the top, `posterior` how sure that is; `fitting` is the whole; `plain` is the search of
`compare --fit` for heading and offset alone.
"""

from sonarhw_compare.fit.fitting import fit_scans
from sonarhw_compare.fit.plain_fit import Fit, fit_scan
from sonarhw_compare.fit.values.fit_result import Estimate, FitOptions, FitResult, Mode, PlacedScan
from sonarhw_compare.fit.values.parameters import Kind, Parameter, free_parameters

__all__ = [
    "Estimate",
    "Fit",
    "FitOptions",
    "FitResult",
    "Kind",
    "Mode",
    "Parameter",
    "PlacedScan",
    "fit_scan",
    "fit_scans",
    "free_parameters",
]
