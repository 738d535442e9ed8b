# The public names; each is loaded when it is first used.
from .drawings import draw_located, draw_map, draw_plan
from .explain import describe_path, details, explain_reading
from .fit import Estimate, FitOptions, FitResult, Parameter, PlacedScan, fit_scan, fit_scans, free_parameters
from .fit.fitting import fitted_board, fitted_room
from .fit.quantities import QUANTITIES, Quantity
from .foreign_rows import Meaning
from .imports import CsvColumns, ImportedScan, ImportOptions, guess_columns, import_scan, read_foreign_scan
from .locate import Located, Pose, locate_scan
from .map import RoomMap, map_scans
from .match import Comparison, Matched, Summary, compare_readings
from .regions import Region
from .report import Report, report_html, report_of
from .score import RegionMatch, RegionPair, compare_regions

__all__ = [
    "QUANTITIES",
    "Comparison",
    "CsvColumns",
    "Estimate",
    "FitOptions",
    "FitResult",
    "ImportOptions",
    "ImportedScan",
    "Located",
    "Matched",
    "Meaning",
    "Parameter",
    "PlacedScan",
    "Pose",
    "Quantity",
    "Region",
    "RegionMatch",
    "RegionPair",
    "Report",
    "RoomMap",
    "Summary",
    "compare_readings",
    "compare_regions",
    "describe_path",
    "details",
    "draw_located",
    "draw_map",
    "draw_plan",
    "explain_reading",
    "fit_scan",
    "fit_scans",
    "fitted_board",
    "fitted_room",
    "free_parameters",
    "guess_columns",
    "import_scan",
    "locate_scan",
    "map_scans",
    "read_foreign_scan",
    "report_html",
    "report_of",
]
