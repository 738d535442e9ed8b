"""The worked notebook runs as it stands, and finds what it is about."""

import contextlib
import io
import json
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import pytest

NOTEBOOK = Path("docs/notebook.ipynb")


def printed(cell: dict[str, Any]) -> str:
    return "".join("".join(output["text"]) for output in cell["outputs"] if output["output_type"] == "stream")


def test_notebook_runs_and_finds_what_it_shows() -> None:
    plt.switch_backend("agg")  # wants no display; the environment is not asked where matplotlib is loaded already
    cells = [cell for cell in json.loads(NOTEBOOK.read_text())["cells"] if cell["cell_type"] == "code"]
    names: dict[str, Any] = {}
    for cell in cells:
        assert cell["execution_count"] is not None, (
            "a cell without output: jupyter execute --inplace docs/notebook.ipynb"
        )
        told = io.StringIO()
        with contextlib.redirect_stdout(told):
            exec(compile("".join(cell["source"]), str(NOTEBOOK), "exec"), names)
        assert len(told.getvalue().splitlines()) == len(printed(cell).splitlines())
    assert names["figures"].within_5cm > 0.9
    # the fake's room is some millimetres off its file
    assert names["fitted"].estimates["x"].value == pytest.approx(1.38, abs=0.01)
    assert names["fitted"].estimates["y"].value == pytest.approx(0.54, abs=0.01)
    assert max(names["located"].places().items(), key=lambda share: share[1])[0] == "p3"
    assert dict(names["results"].sizes) == {"scan": 150, "heading_deg": 72}


def test_pictures_are_stored_in_it_and_it_is_small() -> None:
    assert NOTEBOOK.read_text().count("image/png") == 3
    assert NOTEBOOK.stat().st_size < 200_000
    assert "/tmp/" not in NOTEBOOK.read_text()
