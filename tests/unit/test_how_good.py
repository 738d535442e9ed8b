"""The page of figures for visitors: rows are found in the output of their commands, and others are kept."""

import pytest

from benchmarks.how_good import PAGE, ROWS, TABLE, question_of, with_line

BY_NAME = {row.name: row for row in ROWS}


def table(page: str) -> list[str]:
    found = TABLE.search(page)
    assert found is not None
    return found.group().splitlines()


@pytest.mark.parametrize(
    ("name", "output", "answer"),
    [
        (
            "tracking",
            "30 drives of 20 m in arena, laboratory, 8 sensors, hc-sr04, known start\nmodel            median\n"
            "ray-following    0.007 m  0.015 m  100.0%\ncone             0.340 m  1.400 m  42.0%\n"
            "nearest          0.141 m  1.520 m  51.0%\nodometry alone   0.248 m  0.850 m  33.0%\n",
            "median error 0.007 m in 30 drives of 20 m; with a cone 0.340 m, with the nearest wall 0.141 m",
        ),
        (
            "rooms",
            "        true             found\nroom  walls\n   0      4     1\n   1      5     0\n  12      6     1\n"
            "all                                         99.1%   0.4%  13.0%   9.0%\n",
            "99.1% of the length of the walls within 1 cm and 1°, 0.4% invented; random rooms 0 to 12",
        ),
        (
            "faults",
            "17: prints 'Traceback'\n    ['log']\n20000 inputs, 1 with faults; processor time\n",
            "1 of 20000 inputs give a traceback, a crash, a hang or another fault",
        ),
        (
            "paper",
            "arena      hc-sr04          4.07 ms    0.60 ms   4.8    0.00%   1.60  0.011 ms\n"
            "laboratory hc-sr04          8.12 ms    1.70 ms   3.4    0.00%   1.68  0.011 ms\n"
            "arena      polaroid-6500   33.99 ms    6.99 ms   4.9    0.00%   1.62  0.017 ms\n"
            "paper's algorithm\narena      hc-sr04          5.20 ms\nlaboratory hc-sr04          4.40 ms\n"
            "table of the room         made in\nlaboratory hc-sr04           15.2 s    8.7 MB\n",
            "0.60 ms in the arena, 1.70 ms in the laboratory; by the paper's algorithm 5.20 ms and 4.40 ms",
        ),
        (
            "image_sources",
            "all paths to 7 reflections, 20 walls: times pyroomacoustics        ≥ 1000    2345.0  \n"
            "  share of its 420 paths found, %                                  ≥ 99.5     100.0  \n",
            "2345.0 times, to seven reflections between 20 walls; 100.0 % of its 420 paths are found",
        ),
    ],
)
def test_figures_are_taken_from_the_output_of_the_command(name: str, output: str, answer: str) -> None:
    row = BY_NAME[name]
    assert row.line(output, "2026-12-01") == f"| {row.question} | {answer} | `{row.command}` | 2026-12-01 |"


def test_output_without_figures_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"fuzz 0 20000: expected output with .* got 'killed'"):
        BY_NAME["faults"].line("killed", "2026-12-01")


def test_a_new_line_replaces_that_of_its_question_and_all_else_stays() -> None:
    page = PAGE.read_text(encoding="utf-8")
    new = f"| {BY_NAME['speed'].question} | 1 ms | `one` | 2026-12-01 |"
    changed = with_line(page, new)
    assert [line for line in changed.splitlines() if line not in page] == [new]
    assert len(table(changed)) == len(table(page))
    assert with_line(changed, table(page)[[*map(question_of, table(page))].index(BY_NAME["speed"].question)]) == page


def test_every_line_of_the_page_has_a_row_that_can_measure_it_anew() -> None:
    questions = [row.question for row in ROWS]
    on_page = [question_of(line) for line in table(PAGE.read_text(encoding="utf-8"))]
    assert on_page == sorted(on_page, key=questions.index)
