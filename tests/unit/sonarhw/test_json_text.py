"""The JSON of all commands is JSON: no Infinity and no NaN."""

import json
import math

import numpy as np
import pytest
from sonarhw_cli.options import print_json

from sonarhw.errors import json_text

FIGURES = {
    "deviation": math.inf,
    "low": -math.inf,
    "correlations": np.array([[1.0, np.nan], [np.nan, 1.0]]).tolist(),
    "pair": (np.float64(np.inf), 2),
    "inside": [{"level_db": -math.inf, "name": "NaN", "count": 3, "fits": True, "place": None}],
}
WRITTEN = {
    "deviation": None,
    "low": None,
    "correlations": [[1.0, None], [None, 1.0]],
    "pair": [None, 2],
    "inside": [{"level_db": None, "name": "NaN", "count": 3, "fits": True, "place": None}],
}


def refuse(constant: str) -> None:
    raise AssertionError(constant)


def test_values_that_json_does_not_have_become_null(capsys: pytest.CaptureFixture[str]) -> None:
    assert json.loads(json_text(FIGURES), parse_constant=refuse) == WRITTEN
    print_json(FIGURES)
    assert json.loads(capsys.readouterr().out, parse_constant=refuse) == WRITTEN
