"""Pictures of all commands as PNG, PDF and SVG, by the suffix of the file."""

from pathlib import Path

import pytest
from sonarhw_cli.app import run

ROOM = "rooms/simple.toml"
SIGNATURES = {".png": b"\x89PNG", ".pdf": b"%PDF-", ".svg": b"<?xml"}


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> str:
    out = str(tmp_path_factory.mktemp("pictures") / "scan.mcap")
    assert run(["simulate", ROOM, "--place", "figure9", "--board", "paper", "--step", "10", "--out", out]) == 0
    return out


@pytest.mark.parametrize(
    ("command", "suffix"),
    [("simulate", ".pdf"), *(("compare", suffix) for suffix in SIGNATURES), ("map", ".svg"), ("locate", ".pdf")],
)
def test_the_suffix_selects_the_format_and_the_same_picture_is_the_same_file(
    command: str, suffix: str, log: str, tmp_path: Path
) -> None:
    arguments = {
        "simulate": ["simulate", ROOM, "--place", "figure9", "--out"],
        "compare": ["compare", log, "--plot"],
        "map": ["map", log, "--room", ROOM, "--out"],
        "locate": ["locate", log, "--out"],
    }[command]
    first, second = (tmp_path / f"{name}{suffix}" for name in ("first", "second"))
    assert run([*arguments, str(first)]) == 0
    assert first.read_bytes().startswith(SIGNATURES[suffix])
    if command == "compare":
        assert run([*arguments, str(second)]) == 0
        assert first.read_bytes() == second.read_bytes()


def test_figures_are_drawn_in_the_requested_format(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from sonarhw_compare.paper import figures

    monkeypatch.setattr(figures, "EXHIBITS", figures.EXHIBITS[:1])
    assert run(["figures", str(tmp_path), "--format", "svg"]) == 0
    (picture,) = tmp_path.glob("*.svg")
    assert picture.read_bytes().startswith(b"<?xml")
    assert f"]({picture.name})" in (tmp_path / "figures.md").read_text()


@pytest.mark.parametrize(
    ("command", "option", "suffixes"),
    [
        ("compare", "--plot", ".png, .pdf or .svg"),
        ("map", "--out", ".png, .pdf, .svg, .toml or .html"),
        ("locate", "--out", ".png, .pdf or .svg"),
    ],
)
def test_another_suffix_is_refused_with_the_list(
    command: str, option: str, suffixes: str, log: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([command, log, option, str(tmp_path / "plot.jpg")]) == 2
    assert f"expected a name ending in {suffixes}" in capsys.readouterr().err
