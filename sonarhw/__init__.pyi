# The public names. The first block is the instrument, which this package contains. The others come from the packages
# above it: `__init__.py` loads them by name, so this package does not import them.
from sonarhw_compare import (
    Comparison,
    FitOptions,
    FitResult,
    Located,
    PlacedScan,
    RoomMap,
    draw_located,
    draw_map,
    draw_plan,
    explain_reading,
    map_scans,
)
from sonarhw_compare.drawings import draw_comparison, draw_track
from sonarhw_compare.imports import ImportedScan, ImportOptions, import_scan
from sonarhw_compare.one_call import (
    calibrate,
    compare,
    compare_scans,
    find_missing,
    fit,
    locate,
    map_room,
    save_scan,
    track,
    write_report,
)
from sonarhw_compare.range_table import RangeTable, load_range_table, range_table
from sonarhw_compare.room_import.imported import ImportedRoom, import_room
from sonarhw_compare.scanner_url import open_scanner
from sonarhw_compare.scans import GivenScan, scan_from_arrays
from sonarhw_compare.study import load_study, read_study, run_study
from sonarhw_compare.track import Track, Tracked, Tracker, log_likelihood
from sonarhw_sim import (
    Board,
    Place,
    PredictedScan,
    PredictionOptions,
    Room,
    board_names,
    load_board,
    load_room,
    room_names,
    save_room,
)
from sonarhw_sim.predict.batch import predict_ranges
from sonarhw_sim.predict.settled import predict
from sonarhw_sim.room.room_arrays import room_from_arrays

from .device.fake_board import FakeBoard
from .device.faults import FaultyDevice, read_faults
from .device.served import serve
from .errors import InputError, SonarError
from .host.scanner import PluginScanner, Scanner
from .host.session import Recorder
from .log import Log, LogMetadata, LogWriter, read_log
from .plugins.device_plugin import DeviceIdentity, DevicePlugin, Measurement
from .readings import EchoSource, Ping, PingResult, Reading, ScanOrder, Trace, pings_in_place, sector

__version__: str

__all__ = [
    "Board",
    "Comparison",
    "DeviceIdentity",
    "DevicePlugin",
    "EchoSource",
    "FakeBoard",
    "FaultyDevice",
    "FitOptions",
    "FitResult",
    "GivenScan",
    "ImportOptions",
    "ImportedRoom",
    "ImportedScan",
    "InputError",
    "Located",
    "Log",
    "LogMetadata",
    "LogWriter",
    "Measurement",
    "Ping",
    "PingResult",
    "Place",
    "PlacedScan",
    "PluginScanner",
    "PredictedScan",
    "PredictionOptions",
    "RangeTable",
    "Reading",
    "Recorder",
    "Room",
    "RoomMap",
    "ScanOrder",
    "Scanner",
    "SonarError",
    "Trace",
    "Track",
    "Tracked",
    "Tracker",
    "board_names",
    "calibrate",
    "compare",
    "compare_scans",
    "draw_comparison",
    "draw_located",
    "draw_map",
    "draw_plan",
    "draw_track",
    "explain_reading",
    "find_missing",
    "fit",
    "import_room",
    "import_scan",
    "load_board",
    "load_range_table",
    "load_room",
    "load_study",
    "locate",
    "log_likelihood",
    "map_room",
    "map_scans",
    "open_scanner",
    "pings_in_place",
    "predict",
    "predict_ranges",
    "range_table",
    "read_faults",
    "read_log",
    "read_study",
    "room_from_arrays",
    "room_names",
    "run_study",
    "save_room",
    "save_scan",
    "scan_from_arrays",
    "sector",
    "serve",
    "track",
    "write_report",
]
