"""The readings of a predicted scan: by the paper's receiver, by the board's own, and of the carrier's own body."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.first_echo import Sound, first_echoes
from sonarhw_sim.board.mount import own_range
from sonarhw_sim.board.weighing import PathsAndBeam, Together, beam_table, first_detected, together
from sonarhw_sim.choices import Receiver
from sonarhw_sim.cores import rows_in_parts
from sonarhw_sim.predict.levels import strengths, turned
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.rays.paths import Paths

_LEAST_PART = 120  # headings: fewer take about as long as a thread needs to begin


def with_readings(scan: PredictedScan) -> PredictedScan:
    """Return the scan with the readings of its receiver."""
    if scan.receiver is Receiver.BOARD:
        return with_first_detected(scan)
    return with_first_arrivals(scan) if scan.only_at is None else with_first_echoes(scan)


def with_first_arrivals(scan: PredictedScan) -> PredictedScan:
    """Return what `with_first_echoes` returns, if all paths exist at all headings."""
    board, paths = scan.board, scan.paths
    in_time = np.flatnonzero(scan.in_time & ~paths.scattered)
    sets = together(paths.lengths[in_time], paths.phases[in_time], board.wavelength(scan.room.air), board)
    weighed = paths_and_beam(scan, scan.headings, in_time, sets)

    def detected(begin: int, end: int) -> tuple[NDArray[np.intp]]:
        hidden = weighed.blocked[begin:end]
        return (first_detected(scan.headings[begin:end], weighed._replace(blocked=hidden)),)

    (first,) = rows_in_parts(detected, len(scan.headings), _LEAST_PART)
    # row -1, "no echo", selects the appended value
    winners = np.append(in_time, -1)[first]
    found = replace(scan, winners=winners, distances=np.append(scan.apparent_lengths, np.nan)[winners] / 2)
    return with_first_echoes(found, with_scattered_sound(scan))


def paths_and_beam(
    scan: PredictedScan, headings: FloatArray, rows: NDArray[np.intp] | slice, sets: Together
) -> PathsAndBeam:
    """Return the paths in `rows`, which form these sets, as what the board may detect at `headings` (n,) rad."""
    room, board, paths = scan.room, scan.board, scan.paths
    ka, blocked = board.wavenumber(room.air) * board.aperture_radius, scan.blocked_by_face(paths, headings)
    return PathsAndBeam(
        paths.leaving[rows],
        paths.arriving[rows],
        strengths(room, board, paths)[rows],
        sets,
        np.ascontiguousarray(blocked[:, rows]) if len(blocked) else blocked,  # numba would compile a second layout
        10 ** (board.threshold_db / 20),
        ka,
        beam_table(ka),
    )


def with_first_echoes(scan: PredictedScan, rows: NDArray[np.intp] | None = None) -> PredictedScan:
    """Return the scan with the first of its `echoes` as its readings, at the headings in `rows`; None: at all."""
    winners, distances = scan.winners.copy(), scan.distances.copy()
    for k in range(len(scan.headings)) if rows is None else rows.tolist():
        first = scan.ping(k).first_echo
        winners[k], distances[k] = (first.path, first.length / 2) if first else (-1, np.nan)
    return replace(scan, winners=winners, distances=distances)


def with_first_detected(scan: PredictedScan) -> PredictedScan:
    """Return the scan with the first echoes of the board's own receiver as its readings."""
    times, winners = np.full(len(scan.headings), np.nan), np.full(len(scan.headings), -1, dtype=np.intp)
    one_by_one = np.arange(len(scan.headings))
    if not scan.noise and scan.response is None:
        one_by_one = with_scattered_sound(scan)
        if len(one_by_one) < len(scan.headings):
            times, winners = _first_at_once(scan)
    for k in one_by_one.tolist():
        found = scan.ping(k).first_detected()
        times[k], winners[k] = found.times[0] if len(found.times) else np.nan, found.winner
    return replace(scan, winners=winners, distances=times * scan.room.air.speed_of_sound / 2)


def with_scattered_sound(scan: PredictedScan) -> NDArray[np.intp]:
    """Return the headings at which sound of rough surfaces is at most 20 dB below the threshold, (k,) rows."""
    rough = np.flatnonzero(scan.paths.scattered)
    if not len(rough):
        return np.empty(0, dtype=np.intp)
    if scan.only_at is not None:
        return np.unique(scan.only_at[rough])
    patches = scan.paths.select(rough)
    powers = [(scan.amplitudes_at(k, rough, patches) ** 2).sum() for k in range(len(scan.headings))]
    return np.flatnonzero(np.array(powers) >= scan.unheard_amplitude**2)


def _first_at_once(scan: PredictedScan) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return time, (n,) s, NaN without an echo, and path, (n,), without noise and sound of rough surfaces."""
    speed = scan.room.air.speed_of_sound
    if scan.only_at is None:
        sound = _sound(scan, scan.paths, scan.apparent_lengths, scan.paths.leaving)
        return first_echoes(scan.headings, sound, scan.board, speed)
    times, winners = np.full(len(scan.headings), np.nan), np.full(len(scan.headings), -1, dtype=np.intp)
    for k, heading in enumerate(scan.headings):
        here = scan.rows_at(k)
        here = here[np.argsort(scan.apparent_lengths[here], kind="stable")]
        paths, senders = scan.paths.select(here), heading
        if scan.sender_headings is not None:
            senders = scan.sender_headings[here]
        sound = _sound(scan, paths, scan.apparent_lengths[here], turned(paths.leaving, heading - senders))
        times[k : k + 1], row = first_echoes(scan.headings[k : k + 1], sound, scan.board, speed)
        winners[k] = np.append(here, -1)[row[0]]
    return times, winners


def _sound(scan: PredictedScan, paths: Paths, lengths: FloatArray, leaving: FloatArray) -> Sound:
    """Return the sound along `paths` (p,), in order of their apparent lengths (p,) m, departing along `leaving`."""
    return Sound(
        lengths / scan.room.air.speed_of_sound,
        scan.phasors_of(paths),
        leaving,
        paths.arriving,
        scan.blocked_by_face(paths, scan.headings),
    )


def with_own_body(scan: PredictedScan) -> PredictedScan:
    """Return the scan with the echo of the carrier's own body as reading, wherever it is the nearest; without a path.

    The heading of the scan's place is the actual one of the turntable's zero.
    """
    board, zero = scan.board, scan.place.heading
    owned = [own_range(board.own_body, board.angle_at(heading, zero)) for heading in scan.headings.tolist()]
    own = board.true_ranges(np.array([np.nan if found is None else found for found in owned]))
    nearest = np.fmin(own, scan.distances)
    is_own = nearest == own
    return replace(scan, winners=np.where(is_own, -1, scan.winners), distances=nearest, of_own_body=is_own)
