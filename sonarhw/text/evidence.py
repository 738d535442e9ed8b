"""Decides units, and which number is the angle and the range, from numbers and words; or states what is undecided."""

import math
import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import fmean, median

from sonarhw.errors import InputError, listed
from sonarhw.text.layouts import Layout
from sonarhw.text.numbers import MOST_HEADING, Printed
from sonarhw.text.words import (
    ANGLE_UNITS,
    RANGE_UNITS,
    STEP,
    UNIT_NAMES,
    ColumnKind,
    NameMeaning,
    metric_word,
    words_of,
)

FEWEST = 4  # readings
_HELD, _MOST_HELD = 24, 400  # readings, until a unit is decided
# m: the longest range in a room is at least and at most, with the usual board; their median is at least
_LEAST_ROOM, _MOST_ROOM, _LEAST_MIDDLE = 0.5, 4.05, 0.08
_SMALLEST, LARGEST = 0.1, 11.0  # m, longest range of any scene and board
_FINEST, _COARSEST = 5e-5, 0.31  # m, plausible resolution of a printed range: up to whole feet
_COMMON = ("cm", "mm", "m", "in", "ft", "yd", "us")  # units that sketches print without a name, the most common first
LASER_CODES = (8190.0, 8191.0)  # mm, of laser rangers in place of no echo
_CODES = (*LASER_CODES, 65535.0)  # also of modules with 16 bits
_METRIC = ("cm", "mm", "m", "us")


@dataclass(frozen=True)
class Question:
    """What a text does not decide, and the keys of a URL that decide it."""

    problem: str
    answers: tuple[Mapping[str, str], ...] = ()  # such as unit=cm; empty: the problem names what to do

    def __str__(self) -> str:
        """Return the question in words."""
        answers = [" and ".join(f"{key}={_quoted(value)}" for key, value in answer.items()) for answer in self.answers]
        return f"{self.problem}: add {listed(answers, 'or')}" if self.answers else self.problem


def _quoted(value: str) -> str:
    """Return a value in quotes, as a shell needs it, if it is a pattern."""
    return shlex.quote(value) if "{" in value else value


@dataclass(frozen=True)
class Decision:
    """A decision on a unit."""

    unit: str | None
    assumed: bool = False
    evidence: str = ""
    question: Question | None = None


# units


def range_unit(numbers: Sequence[float], named: NameMeaning, stated: Layout, words: Sequence[str] = ()) -> Decision:
    """Return the unit of printed ranges: stated by the user or the text, else the only plausible one.

    `words`: lines of the text, whose language may exclude inches, feet and yards.
    """
    if stated.scale is not None:
        return Decision(None, True, f"range times {stated.scale:g} m: as given")
    if stated.unit is not None:
        return Decision(stated.unit, True, f"range in {UNIT_NAMES[stated.unit]}: as given")
    if named.unit is not None and named.unit in RANGE_UNITS:
        return Decision(named.unit, False, f"range in {UNIT_NAMES[named.unit]}: {named.word!r} in the text")
    metric = metric_word(word for line in words for word in words_of(line))
    candidates = plausible_units(numbers, named.doubtful or (_METRIC if metric else _COMMON))
    echoes = [number for number in numbers if number > 0]
    spread = f"{min(echoes, default=0):g} to {max(echoes, default=0):g}"
    if len(candidates) == 1:
        (unit,) = candidates
        name = UNIT_NAMES[unit]
        among = f"{metric!r} is of sketches with metric units, and of these " if metric else ""
        why = f"{name} assumed, because {among}only in {name} the numbers {spread} fit a room and the usual board"
        if silent_number(numbers) in LASER_CODES:
            why = f"{name} assumed, because laser rangers that print {name} print {max(echoes):g} for no echo"
        return Decision(unit, True, f"unit of the range not stated: {why}; unit= changes it")
    names = listed([UNIT_NAMES[unit] for unit in candidates], "and") or "no unit"
    answers = tuple({"unit": unit} for unit in candidates or RANGE_UNITS)
    return Decision(None, question=Question(f"unit of the range not stated: {spread} fits {names}", answers))


def plausible_units(numbers: Sequence[float], among: Sequence[str] = _COMMON) -> tuple[str, ...]:
    """Return the units in which ranges fit the usual board and a room, the most common unit first.

    A unit in which they fit only a larger or smaller scene counts if it is more common than all that fit.
    """
    silent = silent_number(numbers)
    echoes = sorted(number for number in numbers if number > 0 and number != silent)
    if not echoes:
        return ()
    if silent in LASER_CODES and "mm" in among and _SMALLEST <= echoes[-1] * RANGE_UNITS["mm"] <= LARGEST:
        return ("mm",)
    quantum, longest, middle = _quantum(echoes), echoes[-1], median(echoes)
    scales = {unit: RANGE_UNITS[unit] for unit in among}
    possible = [
        unit
        for unit, scale in scales.items()
        if quantum * scale <= _COARSEST and _SMALLEST <= longest * scale <= LARGEST
    ]
    printed = [unit for unit in possible if quantum * scales[unit] >= _FINEST]
    chosen: list[str] = []
    fitting = False
    for unit in printed or possible:  # computed ranges have digits without a meaning
        scale = scales[unit]
        fits = _LEAST_ROOM <= longest * scale <= _MOST_ROOM and middle * scale >= _LEAST_MIDDLE
        if fits or not fitting:
            chosen.append(unit)
        fitting = fitting or fits
    if silent is not None and chosen and silent * scales[chosen[0]] > LARGEST:
        # the longest range of a sensor in a finer unit
        finer = [unit for unit in possible if unit not in chosen]
        chosen += [unit for unit in finer if silent in _CODES or 1.0 <= silent * scales[unit] <= _MOST_ROOM]
    return tuple(chosen)


def silent_number(numbers: Sequence[float]) -> float | None:
    """Return the largest number if it is repeated so often that it may stand for no echo; None otherwise."""
    counts = Counter(number for number in numbers if number > 0)
    if len(counts) <= 2:
        return None
    most = max(counts)
    least = 2 if most in _CODES else max(3, 0.08 * counts.total())
    return most if counts[most] >= least else None


def _quantum(numbers: Sequence[float]) -> float:
    for decimals in range(5):
        if all(abs(number - round(number, decimals)) < 1e-9 for number in numbers):
            return float(10.0**-decimals)
    return 1e-4


def angle_unit(numbers: Sequence[float], named: NameMeaning, stated: Layout) -> Decision:
    """Return the unit of printed angles: stated by the user or the text, else the only plausible one."""
    unit = stated.angle or named.unit
    if unit == STEP:
        if stated.step is not None:
            return Decision(STEP, False, f"angle in steps of {stated.step:g}°: as given")
        return Decision(STEP, question=Question("the angle is counted in steps of DEGREES", ({"step": "DEGREES"},)))
    if named.doubtful and stated.angle is None:
        return Decision(None, question=Question(f"{named.word!r} may be degrees or gradians", (_DEGREES, _IN_GRADIANS)))
    if unit is not None and unit in ANGLE_UNITS:
        how = "as given" if stated.angle else f"{named.word!r} in the text"
        return Decision(unit, bool(stated.angle), f"angle in {UNIT_NAMES[unit]}: {how}")
    if not numbers:
        return Decision(None)
    most, span = max(map(abs, numbers)), max(numbers) - min(numbers)
    whole = all(float(number).is_integer() for number in numbers)
    if most <= 2 * math.pi + 0.1 and not whole and (span < 6.0 or len({*numbers}) > 8):
        why = f"radians assumed, because all are below {most + 0.01:.2f}"
        return Decision("rad", True, f"unit of the angle not stated: {why}; angle= changes it")
    if most > 400:
        return Decision(None, question=Question(f"angles up to {most:g} are no degrees", (_IN_STEPS, _DEGREES)))
    if most > 360:
        problem = f"angles up to {most:g} may be gradians or degrees"
        return Decision(None, question=Question(problem, (_IN_GRADIANS, _DEGREES)))
    return Decision("deg", False, DEGREES_ASSUMED)


_DEGREES, _IN_GRADIANS, _IN_STEPS = {"angle": "deg"}, {"angle": "gon"}, {"angle": STEP, "step": "DEGREES"}
BY_SWEEP = "because it sweeps"  # evidence of a number without a name
DEGREES_ASSUMED = "unit of the angle not stated: degrees assumed; angle= changes it"  # evidence
TURN_ASSUMED = "direction of the angle not stated: counter-clockwise assumed; turn=cw changes it"  # evidence
_STEPS_OF_A_TURN = (24, 32, 48, 50, 64, 96, 100, 128, 200, 240, 256)  # of motors and encoders
_GRADIANS = (50.0, 100.0, 200.0, 300.0)  # parts of a turn that are round in gradians only
_NARROW = 80.0  # degrees; few radars sweep less
_ROUND = 5.0  # degrees; the ends of their sweeps are multiples


def angle_question(headings: Sequence[float], begins_whole: bool = False, named: bool = False) -> Question | None:
    """Return the question in which unit angles are that are taken for degrees; None if they are degrees.

    It is None as long as neither a sweep has ended nor the text is whole. `headings` are in the order of the text.
    `named`: a word says that they are angles, so they count no steps.
    """
    steps = [after - before for before, after in pairwise(headings) if after != before]
    if len(headings) < 2 * FEWEST or not steps or not (begins_whole or turns_back(headings)):
        return None
    low, high = min(headings), max(headings)
    step, span = median(map(abs, steps)), high - low
    jumps_back = any(abs(change) > span / 2 for change in steps)
    around = span + step if jumps_back else span  # the last angle of a turn is a step before the first one
    if abs(around - 360) < step / 100:
        return None
    counts = step == 1 and low in (0, 1) and (span < _NARROW or bool(high % _ROUND and (high + 1) % _ROUND))
    of_motor = low == 0 and around in _STEPS_OF_A_TURN
    others = {
        "gradians": _IN_GRADIANS if {span, around} & {*_GRADIANS} and low % 50 == 0 else None,
        "steps": _IN_STEPS if not named and (counts or of_motor) else None,
    }
    answers = {name: answer for name, answer in others.items() if answer}
    spread = f"angles from {low:g} to {high:g} may be degrees or {' or '.join(answers)}"
    return Question(f"unit of the angle not stated: {spread}", (_DEGREES, *answers.values())) if answers else None


class UnitChoice:
    """Decides the unit of readings without one: holds them back until only one unit is plausible."""

    def __init__(self) -> None:
        self.notes: tuple[str, ...] = ()
        self._unit: str | None = None
        self._held: list[tuple[float, Printed]] = []

    def add(self, readings: Sequence[tuple[float, Printed]], last: bool = False) -> list[tuple[float, Printed]]:
        """Return readings with units, each with its time; none while the unit is undecided.

        `last`: no more will follow. Raises InputError if several units are plausible.
        """
        if self._unit is None and not self._held and not any(map(_lacks_unit, (reading for _, reading in readings))):
            return [*readings]
        self._held += readings
        if self._unit is None and not self._decide(last):
            return []
        held, self._held = self._held, []
        scale = RANGE_UNITS[self._unit or "m"]
        return [
            (when, reading if reading.scale is not None else replace(reading, scale=scale)) for when, reading in held
        ]

    def _decide(self, last: bool) -> bool:
        numbers = [number for _, reading in self._held if _lacks_unit(reading) for number in reading.numbers]
        if len(self._held) < _HELD and not last:
            return False
        decision = range_unit(numbers, NameMeaning(), Layout())
        if decision.unit is None and not last and len(self._held) < _MOST_HELD:
            return False
        if decision.unit is None:
            raise InputError(str(decision.question))
        self._unit, self.notes = decision.unit, (decision.evidence,)
        return True


def _lacks_unit(printed: Printed) -> bool:
    return printed.scale is None and bool(printed.numbers)


# which number is the angle, and which the range


def sweeps(numbers: Sequence[float]) -> float:
    """Return how regularly numbers change, from 0 to 1: those of an angle have equal steps and equal repetitions."""
    if len(numbers) < FEWEST or len({*numbers}) < 3:
        return 0.0
    runs: list[int] = [1]
    steps = []
    for before, after in pairwise(numbers):
        if after == before:
            runs[-1] += 1
        else:
            runs.append(1)
            steps.append(round(abs(after - before), 6))
    usual = median(steps)
    tolerance = max(1e-3 * usual, 2e-4)
    same = sum(abs(step - usual) <= max(tolerance, 0.02 * usual) for step in steps) / len(steps)
    inner = runs[1:-1] or runs
    usual_run = Counter(inner).most_common(1)[0][1] / len(inner)
    return same * usual_run


def turns_back(numbers: Sequence[float]) -> bool:
    """Return whether numbers grow and fall, or jump back: an angle does, a counter does not."""
    signs = {math.copysign(1, after - before) for before, after in pairwise(numbers) if after != before}
    return len(signs) > 1


REGULAR, _IRREGULAR, _EXACT = 0.75, 0.6, 0.97
_MOST_STEPS = 100_000  # of an angle that is counted in steps
_CLEARLY = 0.1  # difference of two such shares


@dataclass(frozen=True)
class Label:
    """What the words around a number say."""

    meaning: NameMeaning
    named: bool  # whether any word is there
    between: str = ""  # a unit that may be of this number, or the name of the next one


Roles = tuple[int | None, list[int], list[str]]  # columns of the angle and of the ranges, and the evidence


def column_roles(columns: list[list[float]], labels: list[Label]) -> Roles | str:
    """Return the columns of the angle and of the ranges, with the evidence; or the question that decides."""
    meanings = [label.meaning for label in labels]
    angles = [k for k, meaning in enumerate(meanings) if meaning.quantity is ColumnKind.ANGLE]
    ranges = [k for k, meaning in enumerate(meanings) if meaning.quantity is ColumnKind.RANGE]
    unsupported = [meaning.word for meaning in meanings if meaning.quantity is ColumnKind.UNSUPPORTED]
    if unsupported and not ranges:
        return f"{unsupported[0]!r} is not a unit of a range; expected {', '.join(RANGE_UNITS)}"
    if len(angles) > 1:
        moving = [k for k in angles if len({*columns[k]}) > 1]
        if len(moving) != 1:
            return "several numbers are named as angles; write a pattern="
        angles = moving
    free = [
        k
        for k, meaning in enumerate(meanings)
        if meaning.quantity in (None, ColumnKind.UNSUPPORTED) and len({*columns[k]}) > 1 and k not in (*angles, *ranges)
    ]
    ranges, evidence = _without_copies(columns, meanings, ranges)
    if not angles:
        angle = _angle_among(columns, free, bool(ranges))
        if isinstance(angle, str):
            return angle
        angles = [] if angle is None else [angle]
        if angles and not labels[angles[0]].named:
            evidence.append(f"angle: number {angles[0] + 1} of the line, {BY_SWEEP}")
    if not ranges:
        rest = [k for k in free if k not in angles]
        rest = [k for k in rest if not _is_counter(columns[k])] or rest
        if len(rest) != 1:
            return (
                "no number is a range by its name or numbers"
                if not rest
                else "several numbers may be the range; write a pattern="
            )
        if not angles:
            # a single number that neither sweeps nor is named
            return "no number is named as a range or sweeps as an angle; write a pattern="
        ranges = rest
        evidence.append(f"range: number {rest[0] + 1} of the line, because it does not sweep")
    return (angles[0] if angles else None), ranges, evidence


def both_ways(readings: Sequence[Printed]) -> float:
    """Return how much the ranges of a sweep differ from those of the sweep back, in the unit of the text.

    It is infinite unless angles occur in both directions.
    """
    ranges: dict[tuple[float, bool], list[float]] = {}
    for before, after in pairwise(readings):
        if before.heading is None or after.heading is None or after.heading == before.heading or not after.numbers:
            continue
        ranges.setdefault((after.heading, after.heading > before.heading), []).append(after.numbers[0])
    middle = {key: median(values) for key, values in ranges.items()}
    both = {heading for heading, up in middle if up} & {heading for heading, up in middle if not up}
    differences = [abs(middle[heading, True] - middle[heading, False]) for heading in both]
    return fmean(differences) if len(differences) >= 2 * FEWEST else math.inf


_SAME, _MOST_DIFFERENT = 0.03, 0.1  # of a range, by which the same one may differ in another unit; of the readings


def _without_copies(
    columns: list[list[float]], meanings: list[NameMeaning], ranges: list[int]
) -> tuple[list[int], list[str]]:
    """Return the ranges without those that print another one again, and the evidence.

    A range may follow its echo time, or stand in inches beside centimetres.
    """
    distances = [k for k in ranges if meanings[k].unit != "us" and meanings[k].doubtful != ("us",)]
    if distances and len(distances) < len(ranges):
        return distances, ["the echo time is ignored: the range beside it is read"]
    scales = {k: RANGE_UNITS[unit] for k in ranges if (unit := meanings[k].unit) is not None}
    if len(ranges) < 2 or len({*scales.values()}) < len(ranges):
        return ranges, []
    steps = {k: _quantum(columns[k]) * scale for k, scale in scales.items()}
    finest = min(ranges, key=steps.__getitem__)
    for k in ranges:
        pairs = [(a * scales[k], b * scales[finest]) for a, b in zip(columns[k], columns[finest], strict=True)]
        different = sum(abs(a - b) > _SAME * b + steps[k] for a, b in pairs)
        if different > _MOST_DIFFERENT * len(pairs):
            return ranges, []
    unit = meanings[finest].unit or "m"
    return [finest], [f"the same range in several units: that in {UNIT_NAMES[unit]} is read"]


def radar_roles(literals: tuple[str, ...], columns: list[list[float]], ends: str) -> Roles | None:
    """Return the roles of the sketch "Arduino radar", which prints `90,23.`; None for other text."""
    first, *between, last = (literal.strip() for literal in literals)
    if first or ends + last not in (".", "#") or between not in ([","], ["*"]):
        return None
    angle, distance = (sweeps(column) for column in columns)
    plausible = min(columns[0]) >= 0 and max(columns[0]) <= 360
    return (0, [1], []) if plausible and angle >= max(REGULAR, distance - 0.01) else None


def _is_counter(numbers: Sequence[float]) -> bool:
    """Return whether numbers only grow, as times and counters do; large ones may jump back at a restart."""
    return sweeps(numbers) >= (REGULAR if _is_large(numbers) and turns_back(numbers) else _IRREGULAR) and (
        _is_large(numbers) or not turns_back(numbers)
    )


def _angle_among(columns: list[list[float]], free: list[int], range_is_named: bool) -> int | str | None:
    """Return the column that sweeps; None if none does; a question if several may be the angle."""
    scores = {k: sweeps(columns[k]) for k in free if max(map(abs, columns[k])) <= _MOST_STEPS}
    regular = [k for k, score in scores.items() if score >= REGULAR]
    if not regular:
        return None
    # a time or a counter grows in equal steps, too
    turning = [k for k in regular if turns_back(columns[k])]
    counters = [k for k in regular if k not in turning and _may_be_counter(columns[k])]
    if any(not _is_large(columns[k]) for k in turning):  # a time jumps back where the device restarts
        counters += [k for k in turning if _is_large(columns[k])]
    candidates = [k for k in regular if k not in counters] if turning else regular
    best = max(candidates, key=scores.__getitem__)
    others = [k for k in candidates if k != best and scores[k] > scores[best] - _CLEARLY]
    if counters and scores[best] < _EXACT:
        others += counters
    if not range_is_named:
        others += [k for k in scores if k not in (*candidates, *counters) and scores[k] > scores[best] - _CLEARLY]
    if others:
        names = " and ".join(f"number {k + 1}" for k in sorted({best, *others}))
        return f"{names} of the line both sweep: write a pattern= with {{deg}} for the angle"
    return best


def _may_be_counter(numbers: Sequence[float]) -> bool:
    """Return whether numbers that only grow may be a time or a counter: by ones, or farther than an angle."""
    step = abs(numbers[1] - numbers[0])
    return _is_large(numbers) or step == 1.0


def _is_large(numbers: Sequence[float]) -> bool:
    """Return whether numbers are no degrees of a turntable."""
    return max(map(abs, numbers)) > MOST_HEADING
