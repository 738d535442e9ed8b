"""The notebook runs, and its results agree with its text."""

import contextlib
import io
import json
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import pytest

NOTEBOOK = Path("docs/how_to/notebook.ipynb")


def printed(cell: dict[str, Any]) -> str:
    return "".join("".join(output["text"]) for output in cell["outputs"] if output["output_type"] == "stream")


def test_notebook_runs_and_reproduces_its_results() -> None:
    plt.switch_backend("agg")  # needs no display; matplotlib is loaded already and ignores MPLBACKEND
    cells = [cell for cell in json.loads(NOTEBOOK.read_text())["cells"] if cell["cell_type"] == "code"]
    names: dict[str, Any] = {}
    for cell in cells:
        assert cell["execution_count"] is not None, (
            "a cell without output: jupyter execute --inplace docs/how_to/notebook.ipynb"
        )
        text = io.StringIO()
        with contextlib.redirect_stdout(text):
            exec(compile("".join(cell["source"]), str(NOTEBOOK), "exec"), names)
        assert len(text.getvalue().splitlines()) == len(printed(cell).splitlines())
    assert names["figures"].within_5cm > 0.9
    # the fake's room differs from its file by some millimetres
    assert names["fitted"].estimates["x"].value == pytest.approx(1.38, abs=0.01)
    assert names["fitted"].estimates["y"].value == pytest.approx(0.54, abs=0.01)
    assert max(names["located"].places().items(), key=lambda share: share[1])[0] == "p3"
    assert dict(names["results"].sizes) == {"scan": 150, "heading_deg": 72}


def test_the_notebook_contains_its_pictures_and_is_small() -> None:
    assert NOTEBOOK.read_text().count("image/png") == 4
    assert NOTEBOOK.stat().st_size < 200_000
    assert "/tmp/" not in NOTEBOOK.read_text()
