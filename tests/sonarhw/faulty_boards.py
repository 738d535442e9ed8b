"""Fake boards under a schedule of faults, for tests."""

from dataclasses import replace

from sonarhw.board import Board, BoardIdentity
from sonarhw.faults import read_faults
from sonarhw.faulty import FaultyDevice, afflicted
from tests.sonarhw.plain_echoes import PlainEchoes


def faulty(spec: str, seed: int = 1) -> FaultyDevice:
    """A board under these faults."""
    faults = read_faults(spec)
    identity = afflicted(BoardIdentity(), faults)

    def switched_on(boots: int) -> Board:
        return Board(PlainEchoes(), seed=7, identity=replace(identity, boot=1 + boots))

    return FaultyDevice(switched_on, faults, seed)
