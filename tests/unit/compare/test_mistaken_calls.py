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
    "by_name": [object(), "a", 3, [[1, 2]], {"a": "b"}, {"a": [1]}],
    "times": [*NO_ARRAY, [1.0], [math.nan] * 8],
}

# the arguments of each kind, besides the one with its name; `name=kind` in a call overrides this
ARGUMENTS = {
    "scan": "first second scans",
    "place": "start pose position",
    "pair": "spread drift",
    "headings": "distances directions",
    "number": "height spacing step heading offset temperature temperature_c start_deg step_deg",
    "share": "cell heading_deviation noise room_tolerance speed_of_sound",
    "whole": "particles seed pings samples max_bounces workers count",
    "flag": "degrees levels paths exact find overwrite closed reflectances diffraction",
    "function": "progress connect",
    "file": "path folder",
    "text": "sweeps spec url",
    "words": "fit free priors",
    "choice": "model receiver unit",
    "options": "order",
    "result": "comparison located track found study",
    "points": "walls",
}
KINDS = {name: name for name in WRONG} | {name: kind for kind, names in ARGUMENTS.items() for name in names.split()}
# the right arguments, of every call that has them
RIGHT: dict[str, Any] = {
    **{"room": ROOM, "board": BOARD, "scan": PAIR, "first": PAIR, "second": PAIR, "scans": PAIR, "study": None},
    **{"place": (1, 1), "places": (1, 1), "start": (1, 1, 0), "poses": [[1, 1, 0]], "position": (1, 1), "index": 0},
    **{"headings": HEADINGS, "ranges": SCAN.ranges, "walls": [[0, 0], [3, 0], [3, 2]], "distances": 1.0, "name": "a"},
    **{"spacing": 0.5, "step": 1.0, "particles": 10, "file": "missing.npz", "path": "new.mcap", "comparison": None},
    **{"folder": "out"},
}
CALLS: dict[Callable[..., Any], str] = {
    sonarhw.predict: "room place board headings degrees model options",
    sonarhw.predict_ranges: "room poses board headings degrees levels paths height options",
    sonarhw.range_table: "room board spacing step progress",
    sonarhw.load_range_table: "file room board",
    sonarhw.log_likelihood: "room poses headings ranges board degrees cell receiver",
    sonarhw.Tracker: "room board start particles spread drift model cell seed",
    sonarhw.compare: "scan room place board fit model receiver pings room_tolerance progress",
    sonarhw.compare_scans: "first second sweeps",
    sonarhw.fit: "scans room places board free priors samples seed exact receiver",
    sonarhw.locate: "scan room board height heading heading_deviation receiver",
    sonarhw.track: "scan room board start particles spread drift model seed",
    sonarhw.save_scan: "scan path room place board overwrite",
    sonarhw.map_room: "scans places room board offset find",
    sonarhw.write_report: "scan path room place board overwrite",
    sonarhw.scan_from_arrays: "headings ranges pose times degrees speed_of_sound",
    sonarhw.room_from_arrays: "walls posts reflectances=shares places=by_name name=text closed temperature_c",
    sonarhw.calibrate: "scans board distances directions order temperature reflectances connect progress",
    sonarhw.load_room: "name=file",
    sonarhw.import_room: "file",
    sonarhw.import_scan: "file options",
    sonarhw.load_board: "name=file",
    sonarhw.load_study: "path",
    sonarhw.read_study: "folder",
    sonarhw.read_log: "path",
    sonarhw.read_faults: "spec",
    sonarhw.open_scanner: "url",
    sonarhw.save_room: "path overwrite",
    sonarhw.run_study: "study folder workers",
    sonarhw.find_missing: "comparison",
    sonarhw.explain_reading: "comparison",
    sonarhw.draw_plan: "scan=result",
    sonarhw.draw_comparison: "comparison",
    sonarhw.draw_located: "located",
    sonarhw.draw_track: "track",
    sonarhw.draw_map: "found",
    sonarhw.map_scans: "scans=result board",
    sonarhw.sector: "start_deg step_deg pings",
    sonarhw.pings_in_place: "count",
    sonarhw.PredictionOptions: "unit max_bounces noise diffraction",
    sonarhw.Place: "name=text position heading",
}
OTHERS: dict[Callable[..., Any], dict[str, Any]] = {
    sonarhw.track: {"scan": sonarhw.scan_from_arrays(*PAIR, pose=np.ones((8, 3)))},
    sonarhw.map_scans: {"scans": []},
    sonarhw.map_room: {"poses": None},
    sonarhw.room_from_arrays: {"places": None},
    sonarhw.calibrate: {"room": None, "places": None, "place": None, "poses": None},
}
MISTAKES = [
    pytest.param(function, argument, WRONG[kind or KINDS[argument]], id=f"{function.__name__}-{argument}")
    for function, words in CALLS.items()
    for argument, _, kind in (word.partition("=") for word in words.split())
]


@pytest.mark.parametrize(("function", "argument", "values"), MISTAKES)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_mistaken_call_is_refused_in_one_line(
    function: Callable[..., Any], argument: str, values: list[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    taken = inspect.signature(function).parameters
    right = {name: value for name, value in (RIGHT | OTHERS.get(function, {})).items() if name in taken}
    for value in values:
        with pytest.raises(InputError) as error:
            function(**right | {argument: value})
        assert str(error.value)
        assert "\n" not in str(error.value)
    assert not [*tmp_path.iterdir()]


def test_every_public_function_is_among_them() -> None:
    assert sum(len(mistake.values[2]) for mistake in MISTAKES) > 800
    public = {name for name in sonarhw.__all__ if inspect.isroutine(getattr(sonarhw, name))}
    assert public - {function.__name__ for function in CALLS} == {"board_names", "room_names", "serve"}
