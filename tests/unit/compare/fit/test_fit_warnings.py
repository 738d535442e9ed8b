"""Warnings about a fit."""

from dataclasses import replace

from sonarhw_compare.fit import PlacedScan
from sonarhw_compare.fit.fitting import unexplained
from sonarhw_compare.match import Summary
from sonarhw_sim.room.room import Place

ADVICE = (
    "of 10 echoes are within 5 cm of the prediction; check the room, the place and the board; "
    "`sonarhw locate` finds an unknown place"
)
SUMMARY = Summary(10, 10, 9, 0.9, 0.0, None, None, {}, 1.0, 0.0, 0.0, 0.0, 0.0)


def test_a_scan_of_which_few_echoes_match_is_named() -> None:
    scans = [
        PlacedScan([], Place("", (0.0, 0.0)), name, f"{name}.mcap" if name else "")
        for name in ("good", "bad", "silent", "")
    ]
    shares = (0.61, 0.59, None, 0.0)
    lines = unexplained(scans, [replace(SUMMARY, within_5cm=share) for share in shares])
    assert [str(line) for line in lines] == [
        f"bad.mcap: only 59% {ADVICE}",
        f"this scan: only 0% {ADVICE}",
    ]
