"""Three hundred sketches that print a known sweep: what is proposed reads it, or a question decides it."""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from sonarhw.text.decoder import make_decoder
from sonarhw.text.numbers import Printed
from sonarhw.text.proposals import propose

WORDS = (
    ("Angle", "Distance"),
    ("Winkel", "Abstand"),
    ("Ángulo", "Distancia"),
    ("Açı", "Uzaklık"),
    ("Hoek", "Afstand"),
    ("Angolo", "Distanza"),
    ("Kąt", "Odległość"),
)
UNITS = {"cm": 0.01, "mm": 0.001, "m": 1.0, "in": 0.0254, "ft": 0.3048}
DIGITS = {"cm": 0, "mm": 0, "m": 3, "in": 1, "ft": 2}
BANNERS = ("", "Radar ready\r\n", "ets Jun  8 2016 00:22:57\r\nrst:0x1\r\n", "HC-SR04 test v1.2\r\n\r\n")


@dataclass(frozen=True)
class Sketch:
    """What a sketch prints, and the readings in it."""

    text: bytes
    truth: tuple[tuple[float, float], ...]  # degrees and m


def sweep(rng: random.Random) -> list[int]:
    step, first = rng.choice((1, 2, 5)), rng.choice((0, 15, 30))
    there = [*range(first, 166 if first else 181, step)]
    if rng.random() < 0.3:
        return [*range(0, 360, step)] * 2
    return [*there, *reversed(there[:-1] if rng.random() < 0.5 else there)]


def wall(degrees: float, size: float) -> float:
    """Return the distance to the walls of a room, m."""
    angle = math.radians(degrees)
    along = [size / abs(c) for c in (math.cos(angle), 1.7 * math.sin(angle)) if abs(c) > 1e-9]
    return min(along)


def line_of(rng: random.Random, unit: str, angle_unit: str) -> tuple[str, Callable[[str, str], str]]:
    """Return a header line, which may be empty, and the function that prints a reading."""
    angle_word, range_word = rng.choice(WORDS)
    separator = rng.choice((",", ";", "\t", " ", ", ", " | "))
    first = rng.random() < 0.7
    match rng.choice(("csv", "words", "lines", "json", "plotter", "columns")):
        case "csv":
            names = (f"{angle_word}_{angle_unit}", f"{range_word}_{unit}")
            header = separator.join(names if first else names[::-1])
            return header + "\r\n", lambda a, r: separator.join((a, r) if first else (r, a)) + "\r\n"
        case "columns":
            header = separator.join(("time_ms", f"{angle_word} ({angle_unit})", f"{range_word} ({unit})", "quality"))
            return header + "\n", lambda a, r: separator.join((str(len(a) * 977), a, r, "1")) + "\n"
        case "json":
            kind = f"angle_{angle_unit}", f"range_{unit}"
            return "", lambda a, r: f'{{"{kind[0]}": {a}, "n": 3, "{kind[1]}": {r}}}\n'
        case "plotter":
            return "", lambda a, r: f"{angle_word}_{angle_unit}:{a},{range_word}_{unit}:{r}\n"
        case "lines":
            return "", lambda a, r: f"{angle_word}: {a} {angle_unit}\r\n{range_word}: {r} {unit}\r\n"
        case _:
            between = rng.choice((" ", "; ", " | ", ", "))
            parts = (f"{angle_word}: {{a}} {angle_unit}", f"{range_word}: {{r}} {unit}")
            text = between.join(parts if first else parts[::-1])
            return "", lambda a, r: text.format(a=a, r=r) + "\n"


def sketch(seed: int) -> Sketch:
    """Return one of the sketches, with a stated unit."""
    rng = random.Random(seed)
    unit, angle_unit = rng.choice(tuple(UNITS)), rng.choice(("deg", "deg", "deg", "rad"))
    header, line = line_of(rng, unit, angle_unit)
    size = rng.uniform(0.3, 1.6)
    text, truth = rng.choice(BANNERS) + header, []
    for number, angle in enumerate(sweep(rng)):
        distance = round(wall(angle, size) / UNITS[unit], DIGITS[unit])
        printed = f"{math.radians(angle):.4f}" if angle_unit == "rad" else str(angle)
        text += line(printed, f"{distance:.{DIGITS[unit]}f}")
        truth.append((math.degrees(float(printed)) if angle_unit == "rad" else angle, distance * UNITS[unit]))
        if rng.random() < 0.01 and number > 5:
            text += rng.choice(("debug: ok\r\n", "\r\n", "heap free\r\n"))
    return Sketch(text.encode(), tuple(truth))


def numbers(readings: list[Printed]) -> list[tuple[float, float]]:
    return [(round(one.heading or 0.0, 3), round(one.ranges[0] if one.ranges else 0.0, 4)) for one in readings]


SEEDS = [*range(20), *(pytest.param(seed, marks=pytest.mark.soak) for seed in range(20, 300))]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_proposal_reads_what_a_sketch_prints(seed: int) -> None:
    printed = sketch(seed)
    proposal = propose(printed.text, begins_whole=True)
    assert proposal.layout is not None, (seed, printed.text[:120])
    assert not proposal.questions, (seed, printed.text[:120])
    from_file = make_decoder(proposal.layout, begins_whole=True)
    found = numbers([*from_file.feed(printed.text), *from_file.end()])
    sign = -1 if proposal.clockwise else 1
    truth = [(round(sign * angle, 3), round(distance, 4)) for angle, distance in printed.truth]
    assert found == truth, (seed, printed.text[:120])
    # the same bytes in pieces, as a port gives them; the first line may be cut
    live = make_decoder(proposal.layout)
    pieces = numbers([one for k in range(0, len(printed.text), 61) for one in live.feed(printed.text[k : k + 61])])
    assert pieces in (found, found[1:])
