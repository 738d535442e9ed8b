"""Text whose layout is not certain gives no layout: a wrong one would give wrong readings in silence."""

from functools import reduce
from operator import xor

import pytest

from sonarhw.text.proposals import LayoutProposal, propose

UP = [*range(0, 181, 5)]
ANGLES = 3 * (UP + UP[::-1])
FEW = {
    "most angles are impossible": [
        f"{a if k % 8 == 0 else 5000 + a} deg {30 + k % 7} cm" for k, a in enumerate(ANGLES)
    ],
    "most ranges are impossible": [f"{a} deg {30 + k % 7 if k % 8 == 0 else 90000} cm" for k, a in enumerate(ANGLES)],
    "most lines are other text": [f"{a} deg 30 cm" if k % 5 == 0 else "waiting" for k, a in enumerate(ANGLES)],
}
SEVERAL = {
    "pos {a} tilt {e} cm {d}": "'cm' is the unit of the number before it or the name of the one after it",
    "{a};{b};{d}cm": "number 1 and number 2 of the line both sweep",
    "{a},{d},{e}": "several numbers may be the range",
    "{a} deg: {d}in, {e}cm": "ranges in several units",
    "angle {a} L {d}cm R {e}cm": "several ranges may be those of several sensors or echoes",
    "angle: {d}cm, {a}": "a name or the unit of an angle or of a range",
    "{a}: {f}' {e}\"": "ranges in several units",
}
READ = {  # a pattern and the end of a line, and how their text is read
    ("{angle},{range:.1f}", "\n"): "csv",  # no comma of a decimal number
    ("{angle}*{range:.0f}#", ""): "arduino-radar",
    ("{angle},{range:.0f}.", "\r\n"): "arduino-radar",
    ("{angle},100.", "\r\n"): "arduino-radar",  # one range is doubted when it is scanned
    ("{range:.0f}*{angle};", ""): "{range}*{deg}",
    ("d {range:.0f}\na {angle}", "\n"): "d {range}\\na {deg}",
    ("S1:{range:.0f}cm S2:{range:.0f}cm S3:{range:.0f}cm S4:9cm", "\n"): "[S{-}:{cm}cm ]...",
    ("A{angle}D{range:.0f}", "\n"): "A{deg}D{range}",
    ("X{angle}V{range:.0f}", "\n"): "X{deg}V{range}",  # neither a coordinate nor a voltage
    ("x{angle} y{range:.0f}", "\n"): "x{deg} y{range}",
    ("deg{angle}cm{range:.0f}", "\n"): "deg{deg}cm{cm}",
    ("Angle {angle}: {inches:.0f}in, {range:.0f}cm", "\n"): "Angle {deg}: {-}in, {cm}cm",
    ("{angle},{signed:.0f}", "\n"): "csv",
    ("a {angle}\nDuration: {time}\nDist: {range:.0f} cm", "\n"): "a {deg}\\nDuration: {-}\\nDist: {cm} cm",
    ("SCAN " + ";".join(f"{k},{{range:.0f}}" for k in range(0, 180, 10)) + ";END", "\n"): "SCAN [{deg},{range};]...END",
    ("#" + ";".join(f"{k}:{{range:.0f}}" for k in range(0, 180, 10)) + "$", "\n"): "#[{deg}:{range};]...$",
    ("\x1b[32m{angle}\x1b[0m\t{range:.2f}", "\n"): "csv",
    ("{start}theta: {angle} Dist: {range:.2f}", "\n"): "{text}theta: {deg} Dist: {range}",
    ("{time},{angle},{range:.1f}", "\n"): "{-},{deg},{range}",  # the time jumps back where the device restarts
    ("{angle},{range:.1f}cm", "\n"): "{deg},{cm}cm",  # no marks of thousands
    ("2024-03-01T{clock}Z {angle} deg {range:.1f} cm", "\n"): "{deg} deg {cm} cm",
    ("01/03/2024 {clock} [RX] - {angle} deg {range:.1f} cm<CR><LF>", "\n"): "{deg} deg {cm} cm<CR><LF>",
    ("up {clock} {angle} deg {range:.1f} cm", "\n"): "up {-}:{-}:{-} {deg} deg {cm} cm",
    ('radar/scan {{"angle": {angle}, "distance": {range:.1f}, "unit": "cm"}}', "\n"): "jsonl",
    (">angle:{angle}\n>distance:{range:.1f}§cm", "\n"): ">angle:{deg}\\n>distance:{cm}§cm",
    ("Angolo: {angle} Distanza: {words}", "\n"): "Angolo: {deg} Distanza: {cm} cm",
    ("Kulma: {angle} deg, Etäisyys: {zero}", "\n"): "Kulma: {deg} deg, Etäisyys: {mm} mm",
    ("{banner}{angle};{range:.1f}", "\n"): "csv",
    ("{sentence}", "\r\n"): "{deg},{range},cm",
}


def sentence(content: str) -> str:
    """Return a sentence of NMEA 0183."""
    return f"${content}*{reduce(xor, content.encode()):02X}"


@pytest.mark.parametrize("lines", FEW.values(), ids=FEW)
def test_a_layout_reads_most_lines_or_is_not_proposed(lines: list[str]) -> None:
    assert propose("\n".join(lines).encode(), True).layout is None


@pytest.mark.parametrize(("line", "question"), SEVERAL.items())
def test_several_numbers_that_may_be_the_same_quantity_are_a_question(line: str, question: str) -> None:
    lines = [
        line.format(a=a, b=2 * a + 3, d=30 + 37 * k % 80, f=3 + k % 5, e=40 + 53 * k % 90) for k, a in enumerate(ANGLES)
    ]
    proposal = propose("\n".join(lines).encode(), True)
    assert proposal.layout is None
    assert question in " ".join(map(str, proposal.questions))


@pytest.mark.parametrize(("layout", "read"), READ.items(), ids=map(repr, READ))
def test_marks_and_names_are_not_mistaken(layout: tuple[str, str], read: str) -> None:
    form, end = layout
    texts = [
        form.format(
            angle=a,
            range=(distance := 100 + 36.7 * k % 80),
            inches=distance / 2.54,
            signed=distance if k % 3 else -1,
            time=20 * (k % 100),
            start="S " if a == 0 else "",
            clock=f"14:02:{0.055 * k:09.6f}",
            words="fuori portata" if k % 9 == 4 else f"{distance:.0f} cm",
            zero="0" if k % 9 == 4 else f"{distance:.0f} mm",
            banner="Booting... v1.2\n" if k == 0 else "",
            sentence=sentence(f"SONAR,{a},{distance:.1f},cm"),
        )
        for k, a in enumerate(ANGLES)
    ]
    whole = "".join(text + end for text in texts)
    proposal = propose(f"{whole}{ANGLES[0]},7".encode() if read == "csv" else whole.encode(), True)  # the last is cut
    assert (proposal.layout.preset or proposal.layout.pattern) == read
    assert len(proposal.readings) >= len(ANGLES)


def test_a_question_about_columns_is_not_avoided_by_other_ends_of_lines() -> None:
    lines = ["angle,voltage", *(f"{a},{0.5 + k % 7 / 100:.3f}" for k, a in enumerate(ANGLES))]
    proposal = propose("\n".join(lines).encode(), True)
    assert (proposal.layout, "'voltage' is not a unit" in str(proposal.questions[0])) == (None, True)


OF_ANGLES = {  # angles without a unit, and what else they may be
    "gradians": ([*range(0, 201, 5), *range(195, -1, -5)], "gradians"),
    "a motor of 200 steps": ([*range(200)], "steps"),
    "steps of a servo": ([*range(31), *range(29, -1, -1)], "steps"),
    "degrees there and back": ([*range(0, 181), *range(179, -1, -1)], None),
    "degrees of a turn": ([*range(0, 360, 5)], None),
    "degrees in the middle": ([*range(40, 141, 5), *range(135, 39, -5)], None),
}


@pytest.mark.parametrize(("angles", "other"), OF_ANGLES.values(), ids=OF_ANGLES)
def test_angles_that_may_be_no_degrees_are_a_question(angles: list[int], other: str | None) -> None:
    text = "".join(f"{angle},{100 + 37 * k % 61}\n" for k, angle in enumerate(3 * angles)).encode()
    (question, *_) = (*map(str, propose(text).questions), "")
    assert (other or "") in question
    assert bool(question) is (other is not None)
    named = propose(b"angle_deg,range_cm\n" + text, begins_whole=True)
    assert named.decided


def alternating(angles: list[int], range_first: bool, lines: int) -> tuple[bytes, list[tuple[int, float]]]:
    """Return the lines of a device from one of its lines on, and its pauses before readings."""
    pieces = []
    for k, angle in enumerate(angles):
        pair = [f"Angle: {angle}\r\n", f"Dist: {100 + angle // 3 + k % 2} cm\r\n"]
        pieces += [(line, 0.04 * (not place)) for place, line in enumerate(pair[::-1] if range_first else pair)]
    pieces = pieces[lines:]
    starts = [sum(len(line) for line, _ in pieces[:k]) for k in range(len(pieces))]
    pauses = [(start, pause) for start, (_, pause) in zip(starts, pieces, strict=True)]
    return "".join(line for line, _ in pieces).encode(), pauses


@pytest.mark.parametrize("range_first", [False, True])
@pytest.mark.parametrize("lines", [0, 1])
def test_the_order_of_lines_follows_from_pauses_or_sweeps(range_first: bool, lines: int) -> None:
    pattern = "Dist: {cm} cm\\nAngle: {deg}" if range_first else "Angle: {deg}\\nDist: {cm} cm"
    text, _ = alternating([*range(0, 181, 10), *range(170, -1, -10)], range_first, lines)
    by_sweeps = propose(text)
    assert by_sweeps.layout is not None
    assert (by_sweeps.layout.pattern, by_sweeps.questions) == (pattern, ())
    text, pauses = alternating(3 * [*range(0, 360, 10)], range_first, lines)
    by_pauses = propose(text, pauses=pauses)
    assert by_pauses.layout is not None
    assert (by_pauses.layout.pattern, by_pauses.questions) == (pattern, ())
    assert "may begin with each of its lines" in str(propose(text).questions[0])


NUMBERS = {  # a line, and the question about it; none where its ranges are read
    "angle {a} dist {r:,} mm": "",
    "{a};{german}": "",
    "Winkel: {a} Abstand: {german} mm": "",
    "0x{a:02X},0x{r:04x}": "",
    '{{"angle": {a}, "range_mm": "{r:,}"}}': "",
    "{a},{r:,}": "may be one number or two",
    "{a},{far:,}": "may be one number or two",  # all above 1000
    "{a};{spaced}": "may be one number or two",
    "{a:02X},{r:04X}": "may be hexadecimal",
    "{a}\t{yards:.2f}": "unit=m, unit=ft or unit=yd",
    "{a},{range_us}": "unit=mm or unit=us",
}


@pytest.mark.parametrize(("line", "question"), NUMBERS.items())
def test_numbers_of_any_notation_are_read_or_are_a_question(line: str, question: str) -> None:
    ranges = [700 + 47 * a * a % 1900 for a in ANGLES]
    texts = {r: f"{r:,}" for r in ranges}
    lines = [
        line.format(
            a=a,
            r=r,
            german=texts[r].replace(",", "."),
            spaced=texts[r].replace(",", " "),
            yards=r / 914.4,
            range_us=r + 800,
            far=r + 1000,
        )
        for a, r in zip(ANGLES, ranges, strict=True)
    ]
    proposal = propose("\n".join(lines).encode(), True)
    assert question in " ".join(map(str, proposal.questions))
    assert proposal.decided != bool(question)
    if not question:
        assert [round(1000 * reading.ranges[0]) for reading in proposal.readings] == ranges


@pytest.mark.parametrize(
    ("shortest", "longest", "decimals", "units"),
    [
        # as printed, and the units in which a person may have measured them
        (0.5, 1.1, 1, ("m", "yd")),
        (0.4, 1.9, 1, ("m", "ft", "yd")),
        (0.6, 1.5, 1, ("m", "yd")),
        (1.0, 2.1, 1, ("m", "ft", "yd")),
        (0.3, 3.9, 1, ("m", "ft", "yd")),
        (0.52, 1.11, 2, ("m",)),
        (0.31, 3.86, 2, ("m",)),
        (0.512, 2.345, 3, ("m",)),
        (20, 390, 0, ("cm",)),
        (12.4, 180.5, 1, ("cm",)),
        (8, 78, 0, ("cm", "in")),
        (9.5, 31.2, 1, ("cm", "in")),
        (200, 3900, 0, ("mm",)),
        (85, 827, 0, ("cm", "mm")),
        (420, 1105, 0, ("mm",)),
        (14, 96, 0, ("in",)),
        (20.5, 71.3, 1, ("in",)),
        (6, 30, 0, ("in",)),
        (1, 6, 0, ("ft",)),
        (2, 9, 0, ("ft",)),
        (3, 12, 0, ("ft", "in")),
        (1.5, 7.5, 1, ("ft", "m")),
        (2.25, 11.75, 2, ("ft",)),
    ],
)
def test_no_unit_is_assumed_while_another_one_is_plausible(
    shortest: float, longest: float, decimals: int, units: tuple[str, ...]
) -> None:
    span = longest - shortest
    ranges = [round(shortest + span * (a * a % 1901) / 1900, decimals) for a in ANGLES]
    proposal = propose("".join(f"{a},{r:.{decimals}f}\n" for a, r in zip(ANGLES, ranges, strict=True)).encode(), True)
    asked = {answer.get("unit", "") for question in proposal.questions for answer in question.answers}
    assumed = {} if proposal.layout is None or proposal.questions else {proposal.layout.unit}
    assert asked | {*assumed} >= {*units}


def test_a_word_of_a_metric_language_leaves_out_inches_and_is_named() -> None:
    def proposed(line: str) -> LayoutProposal:
        lines = [line.format(a=a, inches=14 + a % 43) for a in ANGLES]
        return propose("\n".join(lines).encode(), True)

    spanish, english = proposed("angulo {a} distancia {inches}"), proposed("angle {a} distance {inches}")
    assert spanish.decided
    assert "'angulo' is of sketches with metric units" in " ".join(spanish.evidence)
    assert [question.answers for question in english.questions] == [({"unit": "cm"}, {"unit": "in"})]


@pytest.mark.parametrize(
    ("silent", "unit", "is_read_as_silence"),
    [
        (8190, "mm", True),  # of laser rangers
        (8191, "mm", True),
        (9999, "cm", True),  # no board measures 100 m
        (400, "cm", False),  # a wall, or the sign of no echo: the check of the scan says so
        (999, "cm", False),
        (65535, None, False),
        (2000, None, False),  # the range of a laser ranger in millimetres
    ],
)
def test_no_echo_shows_the_unit_or_is_open(silent: int, unit: str | None, is_read_as_silence: bool) -> None:
    lines = [f"{a} deg {silent if k % 9 == 0 else 60 + (k * 37) % 331}" for k, a in enumerate(ANGLES)]
    proposal = propose("\n".join([*lines, ""]).encode(), begins_whole=True)
    if unit is None:
        (question,) = proposal.questions
        assert {"unit": "cm"} in question.answers
        assert {"unit": "mm"} in question.answers
        return
    assert proposal.layout is not None
    assert (proposal.layout.unit, proposal.questions) == (unit, ())
    silences = [not reading.numbers for reading in proposal.readings]
    assert silences == [is_read_as_silence and k % 9 == 0 for k in range(len(lines))]
