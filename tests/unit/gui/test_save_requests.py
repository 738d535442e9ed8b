"""Saving never writes through a link to a file of another kind."""

from functools import partial
from pathlib import Path

import pytest
from sonarhw_gui.jobs.files import PICTURES, save_file, write_svg

from sonarhw.errors import InputError, OutputError


def test_a_link_to_a_log_is_not_replaced_by_a_picture(tmp_path: Path) -> None:
    log, link = tmp_path / "scan.mcap", tmp_path / "plan.svg"
    log.write_text("mine")
    link.symlink_to(log)
    with pytest.raises(InputError, match=r"plan\.svg: is a link to .*scan\.mcap"):
        save_file(partial(write_svg, "<svg/>"), PICTURES, link, overwrite=True)
    assert log.read_text() == "mine"


def test_a_file_that_appears_while_the_picture_is_drawn_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "plan.svg"

    def write(_: object) -> None:
        path.write_text("mine")

    with pytest.raises(OutputError, match="exists already"):
        save_file(write, PICTURES, path, overwrite=False)
    assert [(one.name, one.read_text()) for one in tmp_path.iterdir()] == [("plan.svg", "mine")]
