"""Scan a room with an ultrasonic ranging board, predict the scan, and compare both.

    import sonarhw

    room = sonarhw.load_room("simple")
    scan = sonarhw.predict(room, "figure9", "paper")
    print(scan.ranges)  # (72,) m, NaN where the board detects no echo

These names are public. Each is loaded when it is first used; everything else may change between versions. Names that
this package does not contain come from `sonarhw_sim` and `sonarhw_compare`.

Scan

- `open_scanner`: opens a serial port, `socket://HOST:PORT`, a fake scanner `fake:ROOM?place=NAME`, a log, or a device
  that prints text `lines:PORT?preset=NAME`.
- `Scanner`: a connected scanner. `Recorder`: the interface for recording its frames and readings.
- `DevicePlugin`, `DeviceIdentity`, `Measurement`: to write a plug-in. `PluginScanner`: deprecated name of `Scanner`.
- `Reading`, `Trace`: the result of one ping. `ScanOrder`, `sector`, `pings_in_place`: the pings of a scan.
- `read_log`, `Log`, `LogWriter`, `LogMetadata`: recordings on disk.

Predict

- `load_room`, `room_names`, `save_room`, `Room`, `Place`: rooms and the places of the sensor in them.
- `room_from_arrays`: a room from polygons, segments and posts. `import_room`, `ImportedRoom`: a room from a file of
  another program.
- `load_board`, `board_names`, `Board`: board profiles.
- `predict`, `PredictionOptions`, `PredictedScan`: the prediction of a scan.
- `predict_ranges`: the ranges at many poses, on all cores. `range_table`, `RangeTable`, `load_range_table`: those of a
  whole room, to be looked up.
- `load_study`, `run_study`, `read_study`: many predictions; needs the extra `study`.

Compare

- `scan_from_arrays`, `GivenScan`: a scan from headings and ranges. `save_scan` writes it as a log.
- `import_scan`, `ImportOptions`, `ImportedScan`: a scan from a file of another program.
- `compare`, `Comparison`, `explain_reading`: each reading beside its prediction, and its cause in words.
- `compare_scans`: two scans by heading, without a room. `find_missing`: changes of the room that explain misfits.
- `calibrate`: a board profile from scans of a plate or of a known room.
- `write_report`: one HTML file about a scan.
- `draw_plan`, `draw_comparison`, `draw_located`, `draw_track`, `draw_map`: results as Matplotlib figures.

Find pose and room

- `fit`, `FitOptions`, `FitResult`, `PlacedScan`: pose, board and room that explain scans best.
- `locate`, `Located`: the possible poses of a scan in a known room.
- `track`, `Track`: the trajectory of a robot, from a log with odometry. `Tracker`, `Tracked`: the same while it moves.
- `log_likelihood`: how well readings fit many poses.
- `map_room`, `map_scans`, `RoomMap`: an unknown room from several scans.

Tests and simulations

- `FakeBoard`, `FaultyDevice`, `read_faults`, `serve`: a fake scanner, its faults, and a port that serves it.
- `EchoSource`, `Ping`, `PingResult`: the interface for the echoes of a fake scanner.

`SonarError` is the base class of all errors in `sonarhw.errors`. `InputError`, for wrong arguments and files, is also a
`ValueError`.
"""

import ast
from importlib import import_module
from importlib.util import resolve_name
from pathlib import Path


def _modules() -> dict[str, str]:
    """Return the module of each public name, as the stub beside this file imports it."""
    stub = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    return {
        name.name: resolve_name("." * statement.level + (statement.module or ""), __name__)
        for statement in stub.body
        if isinstance(statement, ast.ImportFrom)
        for name in statement.names
    }


_MODULES = _modules()
__all__ = sorted(_MODULES)


def __getattr__(name: str) -> object:
    if name == "__version__":
        from importlib.metadata import version

        return version(__name__)
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    # by name: this package is the lowest layer, and must not import the packages above it
    globals()[name] = getattr(import_module(_MODULES[name]), name)
    return globals()[name]


def __dir__() -> list[str]:
    return [*globals(), *__all__]
