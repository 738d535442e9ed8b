"""A fake board that is served in this process, and the names of logs."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import serve
from tests.fixtures.plain_echoes import PlainEchoes


@pytest.fixture
def board() -> FakeBoard:
    return FakeBoard(PlainEchoes(), seed=2)


@pytest.fixture
def url(board: FakeBoard) -> Iterator[str]:
    """The fake board at a URL."""
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        yield endpoint.url


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return tmp_path / "scan.mcap"
