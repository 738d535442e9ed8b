"""Mistaken calls of public functions: each is refused with InputError, in one line that names the argument."""

import inspect
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonarhw
from sonarhw import InputError

HEADINGS = np.radians(np.arange(0, 360, 45))
ROOM = sonarhw.room_from_arrays([[0, 0], [3, 0], [3, 2], [0, 2]], places={"middle": (1.5, 1)})
BOARD = sonarhw.load_board("hc-sr04")
SCAN = sonarhw.predict(ROOM, "middle", BOARD, HEADINGS)
PAIR = HEADINGS, SCAN.ranges
DRIVE = sonarhw.scan_from_arrays(*PAIR, pose=np.ones((8, 3)))

# values of no argument
NONSENSE = [object(), b"bytes", 1j, {1: 2}, len]
NO_NUMBER = [*NONSENSE, "many", [1.0], math.nan, np.array(["a"])]
NO_PLACE = [object(), 1j, 5, [1], [1, 2, 3, 4], ["a", "b"], [[1, 2], [3, 4]], "nowhere", [math.nan, 1], [True, False]]
NO_ARRAY = [object(), "abc", [[1], [2, 3]], ["1", "2"], np.zeros((2, 2, 2, 2)), np.array([True]), [1j], [object()]]
WRONG: dict[str, list[Any]] = {
    "scan": [*NONSENSE, 3, SCAN, ROOM, [1, 2], PAIR[1], "missing.mcap", ([0, 1], [1]), (PAIR[0], PAIR[1] * 0)],
    "room": [*NONSENSE, 3, BOARD, "polaroid-6500", PAIR[0], [[0, 0], [1, 1], [0, 1]]],
    "place": NO_PLACE,
    "places": [object(), 5, [1, 2, 3, 4], ["nowhere"], [[math.nan, 1]], [[1]]],
    "board": [*NONSENSE, 3, ROOM, "laboratory", PAIR[0]],
    "poses": [*NO_ARRAY, [[1, 2, 3, 4]], [[math.nan, 1, 0]], [[1e9, 1, 0]], 3],
    "pair": [*NO_ARRAY, 1, [1, 2, 3], [-1, 1], [math.nan, 1]],
    "headings": [*NO_ARRAY, [math.nan], [math.inf], np.zeros((2, 3))],
    "ranges": [*NO_ARRAY, [-1.0] * 8, [1.0] * 3, np.zeros(8)],
    "number": NO_NUMBER,
    "share": [*NO_NUMBER, -1],
    "whole": [*NO_NUMBER, 1.5, -1],
    "flag": [*NONSENSE, "yes", 1, 0.0],
    "function": [object(), "print", 3],
    "file": [*NONSENSE, 3, PAIR[0]],
    "text": [*NONSENSE, 3, ["a"]],
    "words": [object(), 3, [1, 2], "nothing-known"],
    "choice": [*NONSENSE, "unknown", 3],
    "options": [*NONSENSE, "board", 3],
    "result": [*NONSENSE, 3, "scan", ROOM, BOARD, PAIR[0]],
    "points": [object(), "walls", 3, [1, 2, 3], np.zeros((3, 5)), [[0, 0], [math.nan, 1], [1, 1]], [["a", "b"]], {}],
    "posts": [object(), "post", 3, [[1, 2]], [[1, 1, -1]], [[math.inf, 1, 1]], {"a": [1]}],
    "shares": [object(), "hard", 3, [0.5], {"roof": 0.9}, {"wall": "hard"}, -0.1],
    "by name": [object(), "a", 3, [[1, 2]], {"a": "b"}, {"a": [1]}],
    "times": [*NO_ARRAY, [1.0], [math.nan] * 8],
}

# by function: its right arguments, and the kind of each argument that is given a wrong value
CALLS: list[tuple[Callable[..., Any], dict[str, Any], dict[str, str]]] = [
    (
        sonarhw.predict,
        {"room": ROOM, "place": (1, 1), "board": BOARD, "headings": HEADINGS},
        {"room": "room", "place": "place", "board": "board", "headings": "headings", "degrees": "flag"}
        | {"model": "choice", "options": "options"},
    ),
    (
        sonarhw.predict_ranges,
        {"room": ROOM, "poses": [[1, 1, 0]], "headings": HEADINGS, "board": BOARD},
        {"room": "room", "poses": "poses", "board": "board", "headings": "headings", "degrees": "flag"}
        | {"levels": "flag", "height": "number", "options": "options"},
    ),
    (
        sonarhw.range_table,
        {"room": ROOM, "board": BOARD, "spacing": 0.5, "step": 1.0},
        {"room": "room", "board": "board", "spacing": "number", "step": "number", "progress": "function"},
    ),
    (
        sonarhw.load_range_table,
        {"file": "missing.npz", "room": ROOM, "board": BOARD},
        {"file": "file", "room": "room", "board": "board"},
    ),
    (
        sonarhw.log_likelihood,
        {"room": ROOM, "poses": [[1, 1, 0]], "headings": HEADINGS, "ranges": SCAN.ranges, "board": BOARD},
        {"room": "room", "poses": "poses", "headings": "headings", "ranges": "ranges", "board": "board"}
        | {"degrees": "flag", "cell": "share", "receiver": "choice"},
    ),
    (
        sonarhw.Tracker,
        {"room": ROOM, "board": BOARD, "start": (1, 1, 0)},
        {"room": "room", "board": "board", "start": "place", "particles": "whole", "spread": "pair", "drift": "pair"}
        | {"model": "choice", "cell": "share", "seed": "whole"},
    ),
    (
        sonarhw.compare,
        {"scan": PAIR, "room": ROOM, "place": (1, 1), "board": BOARD},
        {"scan": "scan", "room": "room", "place": "place", "board": "board", "fit": "words", "model": "choice"}
        | {"receiver": "choice", "pings": "whole", "room_tolerance": "share", "progress": "function"},
    ),
    (sonarhw.compare_scans, {"first": PAIR, "second": PAIR}, {"first": "scan", "second": "scan", "sweeps": "text"}),
    (
        sonarhw.fit,
        {"scans": PAIR, "room": ROOM, "places": (1, 1), "board": BOARD},
        {"scans": "scan", "room": "room", "places": "places", "board": "board", "free": "words", "priors": "words"}
        | {"samples": "whole", "seed": "whole", "exact": "flag", "receiver": "choice"},
    ),
    (
        sonarhw.locate,
        {"scan": PAIR, "room": ROOM, "board": BOARD},
        {"scan": "scan", "room": "room", "board": "board", "height": "number", "heading": "number"}
        | {"heading_deviation": "share", "receiver": "choice"},
    ),
    (
        sonarhw.track,
        {"scan": DRIVE, "room": ROOM, "board": BOARD, "start": (1, 1), "particles": 10},
        {"scan": "scan", "room": "room", "board": "board", "start": "place", "particles": "whole", "spread": "pair"}
        | {"drift": "pair", "model": "choice", "seed": "whole"},
    ),
    (
        sonarhw.save_scan,
        {"scan": PAIR, "path": "scan.mcap", "room": ROOM, "place": "middle", "board": BOARD},
        {"scan": "scan", "path": "file", "room": "room", "place": "place", "board": "board", "overwrite": "flag"},
    ),
    (
        sonarhw.map_room,
        {"scans": PAIR, "places": (1, 1), "room": ROOM, "board": BOARD},
        {"scans": "scan", "places": "places", "room": "room", "board": "board", "offset": "number", "find": "flag"},
    ),
    (
        sonarhw.write_report,
        {"scan": PAIR, "path": "report.html", "room": ROOM, "place": (1, 1), "board": BOARD},
        {"scan": "scan", "path": "file", "room": "room", "place": "place", "board": "board", "overwrite": "flag"},
    ),
    (
        sonarhw.scan_from_arrays,
        {"headings": HEADINGS, "ranges": SCAN.ranges},
        {"headings": "headings", "ranges": "ranges", "pose": "place", "times": "times", "degrees": "flag"}
        | {"speed_of_sound": "share"},
    ),
    (
        sonarhw.room_from_arrays,
        {"walls": [[0, 0], [3, 0], [3, 2]]},
        {"walls": "points", "posts": "posts", "reflectances": "shares", "places": "by name", "name": "text"}
        | {"closed": "flag", "temperature_c": "number"},
    ),
    (
        sonarhw.calibrate,
        {"scans": PAIR, "board": BOARD, "distances": 1.0},
        {"scans": "scan", "board": "board", "distances": "headings", "directions": "headings", "order": "options"}
        | {"temperature": "number", "reflectances": "flag", "connect": "function", "progress": "function"},
    ),
    (sonarhw.load_room, {}, {"name": "file"}),
    (sonarhw.import_room, {}, {"file": "file"}),
    (sonarhw.import_scan, {"file": "scan.csv"}, {"file": "file", "options": "options"}),
    (sonarhw.load_board, {}, {"name": "file"}),
    (sonarhw.load_study, {}, {"path": "file"}),
    (sonarhw.read_study, {}, {"folder": "file"}),
    (sonarhw.read_log, {}, {"path": "file"}),
    (sonarhw.read_faults, {}, {"spec": "text"}),
    (sonarhw.open_scanner, {}, {"url": "text"}),
    (sonarhw.save_room, {"room": ROOM, "path": "room.toml"}, {"path": "file", "overwrite": "flag"}),
    (sonarhw.run_study, {"study": None, "folder": "out"}, {"study": "result", "folder": "file", "workers": "whole"}),
    (sonarhw.find_missing, {}, {"comparison": "result"}),
    (sonarhw.explain_reading, {"comparison": None, "index": 0}, {"comparison": "result"}),
    (sonarhw.draw_plan, {}, {"scan": "result"}),
    (sonarhw.draw_comparison, {}, {"comparison": "result"}),
    (sonarhw.draw_located, {}, {"located": "result"}),
    (sonarhw.draw_track, {}, {"track": "result"}),
    (sonarhw.draw_map, {}, {"found": "result"}),
    (sonarhw.map_scans, {"scans": [], "board": BOARD}, {"scans": "result", "board": "board"}),
    (sonarhw.sector, {}, {"start_deg": "number", "step_deg": "number", "pings": "whole"}),
    (sonarhw.pings_in_place, {}, {"count": "whole"}),
    (
        sonarhw.PredictionOptions,
        {},
        {"unit": "choice", "max_bounces": "whole", "noise": "share", "diffraction": "flag"},
    ),
    (sonarhw.Place, {"name": "a", "position": (1, 1)}, {"name": "text", "position": "place", "heading": "number"}),
]


MISTAKES = [
    pytest.param(function, right, argument, WRONG[kind], id=f"{function.__name__}-{argument}")
    for function, right, kinds in CALLS
    for argument, kind in kinds.items()
]


@pytest.mark.parametrize(("function", "right", "argument", "values"), MISTAKES)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_mistaken_call_is_refused_in_one_line(
    function: Callable[..., Any],
    right: dict[str, Any],
    argument: str,
    values: list[Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    for value in values:
        with pytest.raises(InputError) as error:
            function(**right | {argument: value})
        assert str(error.value)
        assert "\n" not in str(error.value)
    assert not [*tmp_path.iterdir()]


def test_every_public_function_is_among_them() -> None:
    assert sum(len(WRONG[kind]) for _, _, kinds in CALLS for kind in kinds.values()) > 800
    public = {name for name in sonarhw.__all__ if inspect.isroutine(getattr(sonarhw, name))}
    assert public - {function.__name__ for function, _, _ in CALLS} == {"board_names", "room_names", "serve"}
