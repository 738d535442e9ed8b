"""`sonarhw figures`: pictures and page, also the committed ones, and refused folders."""

import csv
import io
import re
import shlex
from pathlib import Path

import pytest
from sonarhw_cli.app import run
from sonarhw_compare.paper.figures import EXHIBITS
from sonarhw_compare.paper.scenes import Exhibit, PaperScene

COMMITTED = Path("docs/figures")


def test_committed_page_is_what_the_command_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "paper" / "figures"
    assert run(["figures", str(folder)]) == 0
    out, err = capsys.readouterr()
    assert (folder / "figures.md").read_text() == (COMMITTED / "figures.md").read_text()
    assert {file.name for file in folder.iterdir()} == {file.name for file in COMMITTED.iterdir()}
    assert all(file.stat().st_size < 300_000 for file in folder.iterdir())
    assert all(file.read_bytes().startswith(b"\x89PNG") for file in folder.glob("*.png"))
    rows = re.findall(r"\| (yes|\*\*no\*\*) \|$", (folder / "figures.md").read_text(), re.MULTILINE)
    assert re.fullmatch(rf"\d+ figures; {rows.count('yes')} of {len(rows)} claims hold: .*figures\.md\n", out)
    assert err == ""


@pytest.mark.parametrize("exhibit", EXHIBITS, ids=lambda exhibit: exhibit.name)
def test_axes_of_a_figure_are_labelled(exhibit: Exhibit) -> None:
    last = [axes for axes in exhibit.draw().axes if axes.get_xlabel()]
    assert last
    assert all(re.search(r"\((m|µs|degrees)\)$", axes.get_xlabel()) for axes in last)


EACH = 10  # headings; every tenth shows the options that a command lacks, and the slowest figures take two seconds
SCENES = [scene for exhibit in EXHIBITS for scene in exhibit.scenes if scene.reach is None]


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: f"{scene.room} {scene.place} {scene.unit}")
def test_command_under_a_figure_predicts_the_figure(scene: PaperScene, capsys: pytest.CaptureFixture[str]) -> None:
    words = shlex.split(scene.command, comments=True)[1:]
    step = words.index("--step") + 1
    assert float(words[step]) == scene.degrees[2]
    words[step] = f"{EACH * scene.degrees[2]:g}"
    assert run(words) == 0
    printed = [row["range_m"] for row in csv.DictReader(io.StringIO(capsys.readouterr().out))]
    drawn = ["" if reading.range is None else f"{reading.range:.9g}" for reading in scene.readings]
    assert printed == drawn[::EACH]


def test_ctrl_c_as_soon_as_the_folder_exists_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make = Path.mkdir

    def interrupted(folder: Path, mode: int = 0o777, parents: bool = False, exist_ok: bool = False) -> None:
        make(folder, mode, parents, exist_ok)
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "mkdir", interrupted)
    assert run(["figures", str(tmp_path / "paper" / "figures")]) == 130
    assert list(tmp_path.iterdir()) == []
