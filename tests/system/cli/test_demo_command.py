"""`sonarhw demo` without a window: its files, and their use by other commands."""

import json
from pathlib import Path

import pytest
from sonarhw_cli.app import run

from sonarhw.log import read_log


def test_headless_demo_writes_scan_picture_and_summary(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "result"
    assert run(["demo", "--headless", str(folder)]) == 0
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["n"] == len(read_log(folder / "scan.mcap").readings) == 120
    assert summary["within_5cm"] > 0.8
    assert summary["within_5cm"] < 1.0  # the fake's room deliberately differs from its file
    assert (folder / "overlay.png").read_bytes().startswith(b"\x89PNG")
    assert str(folder / "overlay.png") in capsys.readouterr().out
    capsys.readouterr()
    assert run(["compare", str(folder / "scan.mcap"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == summary
    assert run(["demo", "--headless", str(folder)]) == 0


def test_demo_without_a_display_prints_the_path_of_the_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.chdir(tmp_path)
    assert run(["demo"]) == 0
    assert "demo-result/overlay.png" in capsys.readouterr().out
    assert (tmp_path / "demo-result" / "overlay.png").exists()
