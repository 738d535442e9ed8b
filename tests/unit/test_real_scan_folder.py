"""The layout of the folder of real scans: one line for each way in which it can be wrong."""

from pathlib import Path

import pytest

from benchmarks.real.judged_scans import load_scans


@pytest.mark.parametrize(
    ("listing", "message"),
    [
        (None, "scans.csv: no such file; --help describes the layout"),
        ("scan,x_m,y_m\n", "scans.csv: no column turn; --help describes the layout"),
        ("scan,x_m,y_m,turn\nA00,1,1,cw\n", "A00.csv: no such file, but scans.csv lists it"),
    ],
)
def test_another_layout_gives_one_line(tmp_path: Path, listing: str | None, message: str) -> None:
    if listing is not None:
        (tmp_path / "scans.csv").write_text(listing)
    with pytest.raises(SystemExit) as ended:
        load_scans(tmp_path)
    assert message in str(ended.value)
    assert "\n" not in str(ended.value)


def test_a_missing_folder_gives_one_line(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=r"no such folder: .*nowhere; --help describes the layout"):
        load_scans(tmp_path / "nowhere")
