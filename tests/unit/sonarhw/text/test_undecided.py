"""Text whose layout is not certain gives no layout: a wrong one would give wrong readings in silence."""

import pytest

from sonarhw.text.proposals import propose

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
    ("{time},{angle},{range:.1f}", "\n"): "{-},{deg},{range}",  # the time jumps back where the device restarts
}


@pytest.mark.parametrize("lines", FEW.values(), ids=FEW)
def test_a_layout_reads_most_lines_or_is_not_proposed(lines: list[str]) -> None:
    assert propose("\n".join(lines).encode(), True).layout is None


@pytest.mark.parametrize(("line", "question"), SEVERAL.items())
def test_several_numbers_that_may_be_the_same_quantity_are_a_question(line: str, question: str) -> None:
    lines = [line.format(a=a, b=2 * a + 3, d=30 + 37 * k % 80, e=40 + 53 * k % 90) for k, a in enumerate(ANGLES)]
    proposal = propose("\n".join(lines).encode(), True)
    assert proposal.layout is None
    assert question in " ".join(proposal.questions)


@pytest.mark.parametrize(("layout", "read"), READ.items(), ids=map(repr, READ))
def test_marks_and_names_are_not_mistaken(layout: tuple[str, str], read: str) -> None:
    form, end = layout
    texts = [form.format(angle=a, range=100 + 36.7 * k % 80, time=20 * (k % 100)) for k, a in enumerate(ANGLES)]
    whole = "".join(text + end for text in texts)
    proposal = propose(f"{whole}{ANGLES[0]},7".encode() if read == "csv" else whole.encode(), True)  # the last is cut
    assert (proposal.layout.preset or proposal.layout.pattern) == read


def test_a_question_about_columns_is_not_avoided_by_other_ends_of_lines() -> None:
    lines = ["angle,voltage", *(f"{a},{0.5 + k % 7 / 100:.3f}" for k, a in enumerate(ANGLES))]
    proposal = propose("\n".join(lines).encode(), True)
    assert (proposal.layout, "'voltage' is not a unit" in proposal.questions[0]) == (None, True)
