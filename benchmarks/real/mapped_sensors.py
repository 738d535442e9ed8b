"""Rooms from the scans of each sensor at written positions: `python -m benchmarks.real.mapped_sensors [FOLDER]`.

Finds the arena from one scan of each sensor at each place. Positions are known within 3 cm, headings are unknown, the
profile is the generic one. With `--known`, headings are known within 5°, as by `locate`. `--quick` and `--thorough` are
the other levels of effort. `--refined` begins with the arena and these headings, and finds no walls: its verdicts show
how often a right room is refused.

Printed are the walls of the arena that are found within 3 cm and 2°, the number of other walls, the verdict, and the
processor and elapsed time. Last come the shares of the 95 % intervals that hold the true offset and direction: of right
walls, or with `--refined` of all walls.
"""

import math
import os
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from sonarhw_compare.edits import Z95
from sonarhw_compare.locate import PoseSpread
from sonarhw_compare.rooms.candidates import confirmed, touches_of
from sonarhw_compare.rooms.draft import draft_of_room
from sonarhw_compare.rooms.effort import Effort
from sonarhw_compare.rooms.evidence import FINE, ROUGH, Course, evidence_of, scored
from sonarhw_compare.rooms.frame import in_frame
from sonarhw_compare.rooms.outcome import Verdict, verdict_of
from sonarhw_compare.rooms.refinement import Move, deviations_of, refined, with_threshold
from sonarhw_compare.rooms.search import FoundRoom, find_room_and_poses
from sonarhw_sim.board.profile import load_board

from benchmarks.real.judged_scans import ROOM, RealScan, load_sensors, program_options
from benchmarks.real.mapped_arena import at_mark, nearest_pose, wall_names
from sonarhw.readings import FloatArray

WRITTEN = PoseSpread(0.03, math.inf)
KNOWN = PoseSpread(0.03, math.radians(5))
SAME_TEAM = {"A": "AB", "B": "AB"}  # two recordings by one team are one sensor


def main() -> None:
    """Print a row for each sensor, and how often intervals hold the truth."""
    chosen = program_options(
        "Rooms from the scans of each sensor at written positions.",
        sensors=True,
        known="headings are known within 5°",
        quick="search quickly",
        thorough="search thoroughly",
        refined="refine the arena with known headings, and find no walls",
    )
    effort = Effort.QUICK if chosen.quick else Effort.THOROUGH if chosen.thorough else Effort.NORMAL
    teams: dict[str, list[RealScan]] = {}
    for sensor, scans in load_sensors(chosen.folder).items():
        spots = {scan.spot: scan for scan in reversed(scans)}  # the first one at each place
        teams.setdefault(SAME_TEAM.get(sensor, sensor), []).extend(reversed(spots.values()))
    tested = chosen.sensors.split(",") if chosen.sensors else list(teams)
    if chosen.refined:
        held = [print_refined(sensor, teams[sensor]) for sensor in tested]
    else:
        held = [print_room(sensor, teams[sensor], chosen.known, effort) for sensor in tested]
    offsets, turns = (np.concatenate(several) for several in zip(*held, strict=True))
    print(
        f"95 % intervals of {len(offsets)} walls hold {offsets.mean():.2f} of the offsets, "
        f"{turns.mean():.2f} of the directions"
    )


def print_room(sensor: str, scans: Sequence[RealScan], known: bool, effort: Effort) -> tuple[FloatArray, FloatArray]:
    """Print the room of a sensor; return whether the intervals of its right walls hold offset and direction, (w,)."""
    placed = [at_mark(scan, nearest_pose(scan).heading if known else 0.0) for scan in scans]
    begin, spent = time.perf_counter(), sum(os.times()[:4])
    spreads = [KNOWN if known else WRITTEN] * len(placed)
    found = find_room_and_poses(placed, load_board("lego-nxt"), ROOM.air, spreads, course=Course(effort=effort))
    names, verdict = wall_names(found.draft.segments), verdict_of(found)
    right = sorted({name for name in names if name})
    print(
        f"{sensor:3} {len(right)} of {len(ROOM.walls)} walls within 3 cm and 2°, {names.count(None)} others, "
        f"{len(found.draft.posts)} posts; {verdict_text(verdict)}; "
        f"{sum(os.times()[:4]) - spent:.0f} s of processor time, {time.perf_counter() - begin:.0f} s",
        flush=True,
    )
    return holds(found, names)


def print_refined(sensor: str, scans: Sequence[RealScan]) -> tuple[FloatArray, FloatArray]:
    """Print the arena as refined to the scans of a sensor; return whether intervals hold, as `print_room`."""
    placed = [at_mark(scan, nearest_pose(scan).heading) for scan in scans]
    evidence = evidence_of(placed, [KNOWN] * len(placed), load_board("lego-nxt"), ROOM.air)
    best = scored(evidence, replace(draft_of_room(ROOM), places=tuple(scan.place for scan in placed)))
    for _ in range(2):
        best = with_threshold(evidence, best)
        best = scored(evidence, in_frame(evidence, refined(evidence, best.draft, ROUGH, 4).draft))
    draft = in_frame(evidence, refined(evidence, best.draft, FINE, 8, with_headings=True).draft)
    touches, names = touches_of(evidence, draft), wall_names(draft.segments)
    found = FoundRoom(draft, deviations_of(evidence, draft), touches, 0.0, scans=tuple(placed))
    print(
        f"{sensor:3} {len(set(names) - {None})} of {len(ROOM.walls)} walls within 3 cm and 2°, "
        f"{len(confirmed(evidence, draft).walls)} confirmed; {verdict_text(verdict_of(found))}",
        flush=True,
    )
    return holds(found, ROOM.names)


def verdict_text(verdict: Verdict) -> str:
    """Return a verdict in one line."""
    judged = "a room" if verdict.is_room else "refused: " + "; ".join(verdict.reasons)
    return f"{verdict.explained:.0%} explained; {judged}"


def holds(found: FoundRoom, names: Sequence[str | None]) -> tuple[FloatArray, FloatArray]:
    """Return whether the 95 % intervals of the right walls hold the true offset and direction, (w,) each."""
    offsets, turns = [], []
    for key, name in zip(found.draft.walls, names, strict=True):
        if name is None:
            continue
        start, end = ROOM.walls[ROOM.names.index(name)].reshape(2, 2)
        along = (end - start) / np.hypot(*(end - start))
        wall = found.draft.walls[key]
        middle = found.draft.segment(key).reshape(2, 2).mean(axis=0)
        away = abs(float((middle - start) @ (-along[1], along[0])))
        turned = abs(math.remainder(wall.angle - math.atan2(along[1], along[0]), math.pi))
        offsets.append(away <= Z95 * found.deviations[Move("wall", key, 0)])
        turns.append(turned <= Z95 * found.deviations[Move("wall", key, 1)])
    return np.array(offsets, np.float64), np.array(turns, np.float64)


if __name__ == "__main__":
    main()
