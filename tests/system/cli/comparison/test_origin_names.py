"""`compare` and `report` name readings by their origin: only readings of a scanner are called measured."""

import json
import re
from base64 import b64decode
from pathlib import Path

import pytest
from sonarhw_cli.app import run

from sonarhw.log import read_log
from sonarhw.readings import Origin

ROOM = "rooms/simple.toml"
IN_ROOM = ["--room", ROOM, "--place", "figure9"]
PICTURE = re.compile(r'src="data:image/svg[^;]*;base64,([^"]+)"')


def log_of(origin: Origin, folder: Path) -> str:
    out = str(folder / "scan.mcap")
    if origin is Origin.SIMULATED:
        command = ["simulate", ROOM, "--place", "figure9", "--step", "20", "--out", out]
    elif origin is Origin.FAKE:
        command = ["scan", f"fake:{ROOM}?place=figure9&pace=max", *IN_ROOM, "--step", "20", "--out", out]
    else:
        (folder / "scan.csv").write_text("deg,m\n" + "".join(f"{deg},0.7\n" for deg in range(0, 360, 20)))
        command = ["import", str(folder / "scan.csv"), "--heading", "deg", "--range", "m", "--out", out]
    assert run(command) == 0
    assert read_log(Path(out)).origin is origin
    return out


@pytest.mark.parametrize("origin", [Origin.SIMULATED, Origin.FAKE, Origin.IMPORTED])
def test_readings_that_no_scanner_measured_are_not_called_measured(
    origin: Origin, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, plot, page = log_of(origin, tmp_path), tmp_path / "plot.svg", tmp_path / "scan.html"
    capsys.readouterr()
    assert run(["compare", log, *IN_ROOM, "--plot", str(plot)]) == 0
    printed = capsys.readouterr().out
    assert f"18 {origin} readings" in printed
    assert "only in the scan, " in printed
    assert printed.count(origin) == 1  # in the summary
    assert "measured" not in printed
    # matplotlib writes each text of a picture as a comment
    assert f"<!-- {origin} -->" in plot.read_text()
    assert "measured" not in plot.read_text()
    assert run(["compare", log, *IN_ROOM, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["origin"] == origin
    assert run(["report", log, *IN_ROOM, "--out", str(page)]) == 0
    text = page.read_text()
    assert "<th>scan (m)</th>" in text
    assert "measured" not in text
    pictures = [b64decode(picture).decode() for picture in PICTURE.findall(text)]
    assert len(pictures) == 2
    assert all(f"<!-- {origin} readings -->" in picture and "measured" not in picture for picture in pictures)
