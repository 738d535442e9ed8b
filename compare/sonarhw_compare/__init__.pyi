# The public names; each is loaded when it is first used.
from .explain.details import details
from .explain.sentences import describe_path, explain_reading
from .fit import Estimate, FitOptions, FitResult, Parameter, PlacedScan, fit_scan, fit_scans, free_parameters
from .fit.findings import fitted_board, fitted_room
from .fit.values.quantities import QUANTITIES, Quantity
from .imports.foreign_csv import CsvColumns, guess_columns, read_foreign_scan
from .imports.foreign_rows import Meaning
from .locate.locate_picture import draw_located
from .locate.poses import Located, Pose, locate_scan
from .map.map_picture import draw_map
from .map.room_map import RoomMap, map_scans
from .matching.match import Comparison, Matched, Summary, compare_readings
from .matching.region_match import RegionMatch, RegionPair, compare_regions
from .matching.regions import Region
from .pictures.overlay_picture import draw_plan
from .report.html_report import Report, report_html, report_of

__all__ = [
    "QUANTITIES",
    "Comparison",
    "CsvColumns",
    "Estimate",
    "FitOptions",
    "FitResult",
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
    "locate_scan",
    "map_scans",
    "read_foreign_scan",
    "report_html",
    "report_of",
]
