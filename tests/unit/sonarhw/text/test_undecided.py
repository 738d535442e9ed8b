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
