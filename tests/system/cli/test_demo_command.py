"""`sonarhw demo` without a window: its files, and their use by other commands."""

import json
from pathlib import Path

import pytest
from sonarhw_cli.app import run

from sonarhw.log import read_log
from tests.fixtures.commands import SIMPLE_ROOM


@pytest.fixture
def without_display(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Remove the display, and work in an empty folder."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("without_display")
def test_demo_without_a_display_writes_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "demo-result").mkdir()
    (tmp_path / "demo-result" / "summary.json").write_text("mine")
    (tmp_path / "demo-result-2").write_text("mine too")
    assert run(["demo"]) == 0
    assert "demo-result-3/overlay.png" in capsys.readouterr().out
    assert (tmp_path / "demo-result" / "summary.json").read_text() == "mine"
    assert (tmp_path / "demo-result-2").read_text() == "mine too"
    folder = tmp_path / "demo-result-3"
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["n"] == len(read_log(folder / "scan.mcap").readings) == 120
    assert summary["within_5cm"] > 0.8
    assert summary["within_5cm"] < 1.0  # the fake's room deliberately differs from its file
    assert (folder / "overlay.png").read_bytes().startswith(b"\x89PNG")
    assert run(["compare", str(folder / "scan.mcap"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == summary | {"fit": None}
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert run(["demo", "--headless", str(folder)]) == 2
    assert "scan.mcap: exists already; choose another --headless or add --force" in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert run(["demo", "--headless", str(folder), "--force"]) == 0
    assert str(folder / "overlay.png") in capsys.readouterr().out
    # a log contains the time of its recording; the other files are the same again
    after = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert after["scan.mcap"] != before["scan.mcap"]
    assert [after[name] == before[name] for name in ("overlay.png", "summary.json")] == [True, True]


@pytest.mark.usefixtures("without_display")
def test_gui_without_a_display_names_commands_for_the_log(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["simulate", str(SIMPLE_ROOM), "--place", "figure9", "--out", "my scan.mcap"]) == 0
    assert run(["gui", "my scan.mcap"]) == 1
    error = capsys.readouterr().err
    assert "`sonarhw report 'my scan.mcap' --out FILE.html`" in error
    assert "`sonarhw compare 'my scan.mcap' --plot FILE.png`" in error
    assert "demo" not in error
