"""Mutants that no test can detect, each with the reason. They are not part of a sample."""

from tests.mutation.mutants import Mutant

_LARGEST = "critical - 2 * scene.degrees[2] < largest < critical"
_OF_READINGS = "topics.get(item.channel) == READINGS"
# path, line, changes of it, reason
_EQUIVALENTS: list[tuple[str, str, tuple[str, ...], str]] = [
    (
        "compare/sonarhw_compare/fit/likelihood.py",
        "return 1.0 if x > 0.0 else 0.0",
        ("0.0 → (1.0)", "x > 0.0 → (x >= 0.0)"),
        "x is farther than _FAR from 0 (the second 0.0 of the line is left out too)",
    ),
    (
        "compare/sonarhw_compare/scans.py",
        "return boards[0]",
        ("0 → (-1)",),
        "all boards are equal here",
    ),
    (
        "compare/sonarhw_compare/paper/figures.py",
        "seen > 1.2 * wide and level > scenes[0].scan.board.threshold_db + 12,",
        ("0 → (1)", "0 → (-1)"),
        "all scenes have the same board",
    ),
    (
        "sim/sonarhw_sim/board/signal.py",
        "node, constant, linear, square, cube = -1, 0.0j, 0.0j, 0.0j, 0.0j",
        ("-1 → (1)", "1 → (2)"),
        "any node but 0, at which the first sample is",
    ),
    (
        "sim/sonarhw_sim/board/beam.py",
        "while last > 0 and math.isnan(corners[last, 0]):",
        ("0 → (-1)", "0 → (1)"),
        "both coordinates are NaN in padding",
    ),
    (
        "sim/sonarhw_sim/rays/fan.py",
        "if leg.opening > 1.0 or search.targets.shape[0] - 1 <= _FEW_EDGES:",
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
        "every wait ends after TICK, 0.05 s, and checks its condition again",
    ),
    (
        "sonarhw/host/scanner.py",
        "self.changed.notify_all()",
        ("self.changed.notify_all() → pass",),
        "every wait ends after TICK, 0.05 s, and checks its condition again",
    ),
    (
        "sonarhw/host/scripts.py",
        "self.since = 0.0",
        ("0.0 → (1.0)",),
        "`Session.start` sets it before its only use",
    ),
    (
        "sonarhw/device/faults.py",
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
        "compare/sonarhw_compare/paper/figures.py",
        f"{_LARGEST} and not others and bool(np.isnan(scan.ranges).any()),",
        (
            f"{_LARGEST} → (critical - 2 * scene.degrees[2] <= largest < critical)",
            f"{_LARGEST} → (critical - 2 * scene.degrees[2] < largest <= critical)",
        ),
        "all are computed real numbers",
    ),
    (
        "compare/sonarhw_compare/locate.py",
        "shares[name] += pose.probability",
        ("shares[name] += pose.probability → shares[name] -= pose.probability",),
        "the sign cancels when the shares are divided by their sum",
    ),
    (
        "compare/sonarhw_compare/map.py",
        "if before * behind >= 0 or abs(behind) < _BEYOND:",
        ("before * behind → (before / behind)",),
        "only the sign matters; a small divisor is excluded by the other condition",
    ),
    (
        "sonarhw/device/protocol.py",
        "repeats = -(-request.size // len(request.data))",
        ("-request.size // len(request.data) → (-request.size * len(request.data))",),
        "more repeats, of which the same bytes are sent",
    ),
    (
        "sonarhw/log/reader.py",
        "elif topics.get(item.channel) == READINGS and decoder.settings is None:",
        (f"{_OF_READINGS} and decoder.settings is None → ({_OF_READINGS} or decoder.settings is None)",),
        "speeds of readings that have one, and messages that are not JSON",
    ),
    (
        "sonarhw/host/scripts.py",
        "if self.now >= deadline:",
        ("self.now >= deadline → (self.now > deadline)",),
        "the answer to Stop takes time",
    ),
    (
        "sim/sonarhw_sim/predict/room_echoes.py",
        "self._heard(self._scan(place.heading), ping, random)",
        ("self._heard(self._scan(place.heading), ping, random) → pass",),
        "compiles kernels in advance",
    ),
    (
        "sim/sonarhw_sim/predict/room_echoes.py",
        "random = np.random.default_rng((self._seed, 2, whole_microdegrees(ping.angle), ping.sweep, ping.index))",
        (
            "2 → (1)",
            "2 → (3)",
        ),
        "other random numbers",
    ),
    (
        "sim/sonarhw_sim/predict/room_echoes.py",
        "for direction in random.uniform(0, math.tau, 32):",
        ("32 → (48)",),
        "other random numbers, and more attempts",
    ),
    (
        "sim/sonarhw_sim/rays/fan.py",
        "mixed: int = ((first + 1) * 2654435761 ^ (second + 1) * 2246822519) & 0xFFFFFFFF",
        ("2654435761 → (3981653641)",),
        "another hash of the same value",
    ),
    (
        "sim/sonarhw_sim/room/grid.py",
        "return Walk(False, 0, 0, 0, 0, 0.0, 0.0, 0.0, 0.0)",
        (
            "0 → (1)",
            "0 → (-1)",
            "0.0 → (1.0)",
        ),
        "nothing but `inside` is read, which is False",
    ),
    (
        "sim/sonarhw_sim/board/signal.py",
        "for k in range(1, smooth.shape[0]):",
        ("0 → (-1)",),
        "an array of one dimension",
    ),
    (
        "sim/sonarhw_sim/rays/sequences.py",
        "for k in range(sequence.shape[0]):",
        ("0 → (-1)",),
        "an array of one dimension",
    ),
    (
        "compare/sonarhw_compare/pictures.py",
        "above = np.searchsorted(round_, wanted).clip(1, len(round_) - 1)",
        (
            "len(round_) - 1 → (len(round_) + 1)",
            "1 → (0)",
        ),
        "the first and the last element are below 0 and above all headings",
    ),
    (
        "compare/sonarhw_compare/paper/figures.py",
        "for axes, (scene, title) in zip(figure.subplots(1, 2), places, strict=True):",
        ("True → (False)",),
        "two of each",
    ),
    (
        "compare/sonarhw_compare/fit/starting.py",
        "if chosen[h, c] < 0 or math.isnan(ranges[i]):",
        ("0 → (-1)",),
        "where no path is chosen, the chance is 0",
    ),
    (
        "sim/sonarhw_sim/predict/prediction.py",
        "scan = _nearest_wall(room, place, _without_blanking(board, options), headings, np.zeros(1))",
        ("1 → (2)",),
        "the same ray twice",
    ),
    (
        "sim/sonarhw_sim/predict/prediction.py",
        "return predict_scan(room, place, board, headings, replace(options, max_bounces=1, single=True))",
        ("1 → (2)",),
        "`single` drops paths of more reflections",
    ),
    (
        "sim/sonarhw_sim/board/signal.py",
        "_INSTANTS = 1000  # at which the two gains are compared",
        ("1000 → (1500)",),
        "a mean over more instants",
    ),
    (
        "sim/sonarhw_sim/rays/fan.py",
        "going = leg.amplitude * math.sqrt(leg.length / leg.width) > search.faintest",
        ("leg.amplitude * math.sqrt(leg.length / leg.width) → (leg.amplitude / math.sqrt(leg.length / leg.width))",),
        "a tube is at least as wide as it is long, so fewer rays are stopped early",
    ),
    (
        "sonarhw/device/protocol.py",
        "due: float = 0.0",
        ("0.0 → (1.0)",),
        "`_step` sets it before its first use",
    ),
    (
        "sonarhw/readings.py",
        "_TOLERANCE = 1e-6  # rad; less than a microstep",
        ("1e-6 → (1.5e-06)",),
        "a tolerance for rounding errors",
    ),
    (
        "sonarhw/device/served.py",
        "self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)",
        ("self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1) → pass",),
        "the same bytes a little later",
    ),
    (
        "compare/sonarhw_compare/fit/likelihood.py",
        "break",
        ("break → continue",),
        "all paths after this one are too long, too",
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
