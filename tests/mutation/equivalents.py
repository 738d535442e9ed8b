"""Mutants that no test can detect, each with the reason. They are not part of a sample."""

from tests.mutation.mutants import Mutant

_LARGEST = "critical - 2 * scene.degrees[2] < largest < critical"
# path, line, changes of it, reason
_EQUIVALENTS: list[tuple[str, str, tuple[str, ...], str]] = [
    (
        "compare/sonarhw_compare/fit/likelihood/echo_likelihood.py",
        "return 1.0 if x > 0.0 else 0.0",
        ("0.0 → (1.0)", "x > 0.0 → (x >= 0.0)"),
        "x is farther than _FAR from 0 (the second 0.0 of the line is left out too)",
    ),
    (
        "compare/sonarhw_compare/fit/fit_setting.py",
        "return boards[0]",
        ("0 → (-1)",),
        "all boards are equal here",
    ),
    (
        "compare/sonarhw_compare/paper/laboratory_figures.py",
        "seen > 1.2 * wide and level > scenes[0].scan.board.threshold_db + 12,",
        ("0 → (1)", "0 → (-1)"),
        "all scenes have the same board",
    ),
    (
        "sim/sonarhw_sim/board/traces.py",
        "node, constant, linear, square, cube = -1, 0.0j, 0.0j, 0.0j, 0.0j",
        ("-1 → (1)", "1 → (2)"),
        "any node but 0, at which the first sample is",
    ),
    (
        "sim/sonarhw_sim/board/weighing.py",
        "while last > 0 and math.isnan(corners[last, 0]):",
        ("0 → (-1)", "0 → (1)"),
        "both coordinates are NaN in padding",
    ),
    (
        "sim/sonarhw_sim/vertical/lifting.py",
        "points = np.full((len(paths), bounces + 3, 2), np.nan)",
        ("3 → (4)",),
        "one more column of padding",
    ),
    (
        "sim/sonarhw_sim/rays/kernel.py",
        "leg.x, leg.y, leg.dx, leg.dy, reach, leg.opening > 1.0, cells, edges, nearby, met, leg_number",
        ("1.0 → (1.5)",),
        "a post spreads the tube by more than half, unless its radius is larger than four times its distance",
    ),
    (
        "sonarhw/log/mcap_records.py",
        "_WINDOW = 1 << 20",
        ("1 → (2)", "20 → (30)"),
        "size of a buffer",
    ),
    (
        "sonarhw/host/scanner.py",
        "self._changed.notify_all()",
        ("self._changed.notify_all() → pass",),
        "every wait ends after _TICK, 0.05 s, and checks its condition again",
    ),
    (
        "sonarhw/host/job.py",
        "self.since = 0.0",
        ("0.0 → (1.0)",),
        "`Session.start` sets it before its only use",
    ),
    (
        "sonarhw/device/faulty_board.py",
        "self._newest = -1",
        ("-1 → (1)", "1 → (0)", "1 → (2)"),
        "no board makes a ping at 0 s, before it is homed",
    ),
    (
        "sim/sonarhw_sim/compiled.py",
        'options["no_cfunc_wrapper"] = True',
        ("True → (False)",),
        "a wrapper that nothing uses; without it, compilation takes less time",
    ),
    (
        "compare/sonarhw_compare/paper/corner_figures.py",
        f"{_LARGEST} and not others and bool(np.isnan(scan.ranges).any()),",
        (
            f"{_LARGEST} → (critical - 2 * scene.degrees[2] <= largest < critical)",
            f"{_LARGEST} → (critical - 2 * scene.degrees[2] < largest <= critical)",
        ),
        "all are computed real numbers",
    ),
    (
        "compare/sonarhw_compare/locate/poses.py",
        "shares[name] += pose.probability",
        ("shares[name] += pose.probability → shares[name] -= pose.probability",),
        "the sign cancels when the shares are divided by their sum",
    ),
    (
        "compare/sonarhw_compare/map/rejection.py",
        "if before * behind >= 0 or abs(behind) < _BEYOND:",
        ("before * behind → (before / behind)",),
        "only the sign matters; a small divisor is excluded by the other condition",
    ),
]
_KNOWN = {(path, text, change) for path, text, changes, _ in _EQUIVALENTS for change in changes}


def is_equivalent(mutant: Mutant) -> bool:
    """Report whether a mutant is known to have no effect."""
    return key_of(mutant) in _KNOWN


def key_of(mutant: Mutant) -> tuple[str, str, str]:
    """Return path, line and change of a mutant."""
    return mutant.path, mutant.text, f"{mutant.before} → {mutant.after}"


def known() -> set[tuple[str, str, str]]:
    """Return path, line and change of each known equivalent."""
    return set(_KNOWN)
