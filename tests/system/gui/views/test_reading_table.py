"""The table of readings: sorting, filters by class and text, copying, selection with mouse and keys."""

import csv
import io
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QColor, QGuiApplication
from pytestqt.qtbot import QtBot
from sonarhw_compare.match import Kind, compare_readings
from sonarhw_gui.jobs.forecast import ComparedScan, Stretch
from sonarhw_gui.model.look import LengthUnit, Look, Unclassed
from sonarhw_gui.model.rows import CLASSES, NO_ROWS, Column, ReadingRows, RowQuery, order_of, rows_as_csv
from sonarhw_gui.model.scene import NoteTexts, Scene
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.views.table import TableView

from sonarhw.errors import text_cell
from sonarhw.log import read_log
from sonarhw.readings import Reading
from tests.system.gui.driving import PATIENCE, until

COUNT = 36
LONG = 36_000  # readings of an hour


@pytest.fixture(scope="session")
def readings(recorded: Path) -> tuple[Reading, ...]:
    """Return a scan with one missed, one short and one long reading."""
    changed = list(read_log(recorded).readings)
    changed[3] = replace(changed[3], echo_times=())
    changed[5] = replace(changed[5], echo_times=(changed[5].echo_times[0] * 0.7,))
    changed[7] = replace(changed[7], echo_times=(changed[7].echo_times[0] * 1.4,))
    return tuple(changed)


@pytest.fixture(scope="session")
def shown(scene: Scene, readings: tuple[Reading, ...]) -> Shown:
    comparison = compare_readings(readings, scene.room, scene.pose, scene.board)
    return Shown(scene, None, ComparedScan((Stretch(0, comparison),)), readings, chosen=len(readings) - 1)


@pytest.fixture
def table(qtbot: QtBot, shown: Shown) -> TableView:
    table = TableView()
    qtbot.addWidget(table)
    table.resize(900, 300)
    table.show_state(shown)
    with qtbot.waitExposed(table, timeout=PATIENCE):
        table.show()
    return table


def listed(table: TableView, column: Column = Column.NUMBER) -> list[str]:
    model = table.model
    return [model.data(model.index(row, column)) for row in range(model.rowCount())]


def click_row(qtbot: QtBot, table: TableView, row: int) -> None:
    place = table.view.visualRect(table.model.index(row, Column.HEADING)).center()
    qtbot.mouseClick(table.view.viewport(), Qt.MouseButton.LeftButton, pos=place)


def click_header(qtbot: QtBot, table: TableView, column: Column) -> None:
    header = table.view.horizontalHeader()
    qtbot.mouseClick(header.viewport(), Qt.MouseButton.LeftButton, pos=QPoint(header.sectionPosition(column) + 20, 5))


# the rows


def test_rows_have_measured_range_residual_class_and_path(shown: Shown) -> None:
    rows = shown.rows
    for index, row in enumerate(shown.compared.stretches[0].comparison.rows):
        assert rows.measured[index] == pytest.approx(math.nan if row.measured is None else row.measured, nan_ok=True)
        assert rows.residuals[index] == pytest.approx(math.nan if row.residual is None else row.residual, nan_ok=True)
        assert CLASSES[rows.classes[index]] is row.kind
    assert rows.path(27) == "bottom>top>bottom"
    missed = CLASSES.index(Kind.MISSED)
    assert rows.classes[3] == missed
    assert rows.path(3) != ""  # the predicted path


def test_rows_of_a_growing_or_shrinking_scan_equal_newly_built_ones(shown: Shown) -> None:
    rows = NO_ROWS
    for count in (3, 20, 36, 5, 0, 36):
        part = replace(shown, readings=shown.readings[:count])
        rows, afresh = replace(part, earlier=rows).rows, part.rows
        assert rows.readings == afresh.readings
        for name in ("headings", "measured", "predicted", "classes", "paths"):
            assert getattr(rows, name).tolist() == pytest.approx(getattr(afresh, name).tolist(), nan_ok=True), name


def test_a_replay_that_steps_back_keeps_its_rows_and_another_scan_does_not(shown: Shown) -> None:
    whole = shown.rows
    back = replace(shown, readings=shown.readings[:4], earlier=whole)
    assert back.known_rows is whole
    another = tuple(replace(reading) for reading in shown.readings[:4])
    assert replace(back, readings=another).known_rows.readings is another
    assert replace(back, readings=()).known_rows.readings == ()


values = st.one_of(st.just(math.nan), st.floats(-5, 5))


@given(
    st.lists(st.tuples(values, st.integers(0, len(CLASSES) - 1)), max_size=30),
    st.booleans(),
    st.sampled_from((Column.MEASURED, Column.CLASS, Column.HEADING, Column.NUMBER)),
)
def test_sorting_agrees_with_python_and_puts_empty_cells_last(
    cells: list[tuple[float, int]], descending: bool, column: Column
) -> None:
    rows = _rows_with(cells)
    keys = {
        Column.MEASURED: rows.measured,
        Column.CLASS: rows.classes,
        Column.HEADING: rows.headings,
        Column.NUMBER: range(len(cells)),
    }
    key = [float(value) for value in keys[column]]
    valued = [k for k in range(len(cells)) if not math.isnan(key[k])]
    expected = sorted(valued, key=lambda k: -key[k] if descending else key[k])
    empty = [k for k in range(len(cells)) if math.isnan(key[k])]
    assert order_of(rows, RowQuery(column, descending)).tolist() == expected + empty


def _rows_with(cells: list[tuple[float, int]]) -> ReadingRows:
    lengths = np.array([cell[0] for cell in cells])
    zeros = np.zeros(len(cells))
    kinds = np.array([cell[1] for cell in cells], np.int64)
    return ReadingRows((None,) * len(cells), zeros, np.nan_to_num(lengths), lengths, zeros, kinds, kinds * 0 - 1, ())


def test_filtered_rows_contain_every_word_of_the_filter(shown: Shown) -> None:
    rows = shown.rows
    top = order_of(rows, RowQuery(text="top")).tolist()
    assert top == [k for k in range(len(rows)) if "top" in rows.path(k)]
    assert 27 in top
    assert order_of(rows, RowQuery(text="270.0 match bottom")).tolist() == [27]
    assert order_of(rows, RowQuery(text="nothing like it")).tolist() == []


def test_csv_is_in_metres_and_degrees_with_any_look(table: TableView, shown: Shown) -> None:
    notes = NoteTexts({27: 'a door, "open"', 3: "=1+1"})
    table.show_state(replace(shown, look=Look(unit=LengthUnit.FT), notes=notes))
    table.copy_rows()
    text = QGuiApplication.clipboard().text()
    assert text == rows_as_csv(shown.rows, range(COUNT), shown.sentence_of, notes)
    copied = list(csv.DictReader(io.StringIO(text)))
    first, silent = copied[27], copied[3]
    assert (first["heading_deg"], first["class"], first["path"]) == ("270.0000", "match", "bottom>top>bottom")
    assert float(first["measured_m"]) == pytest.approx(shown.readings[27].range, abs=1e-4)
    assert first["sentence"] == shown.sentence_of(27)
    assert [first["note"], silent["note"], copied[4]["note"]] == ['a door, "open"', text_cell("=1+1"), ""]
    assert (silent["measured_m"], silent["residual_m"], silent["class"]) == ("", "", "missed")


# the table


def test_a_click_on_a_column_sorts_by_number_not_by_text(qtbot: QtBot, table: TableView) -> None:
    click_header(qtbot, table, Column.HEADING)
    click_header(qtbot, table, Column.HEADING)
    headings = [float(text.rstrip("°")) for text in listed(table, Column.HEADING)]
    assert headings == sorted(headings, reverse=True)


def test_the_button_of_a_class_hides_and_shows_it(qtbot: QtBot, table: TableView, shown: Shown) -> None:
    button = table.classes[Kind.MATCH]
    matches = table.model.rows.counts()[Kind.MATCH]
    assert button.text() == f"{matches} match"
    table.gestures.switched.connect(
        lambda kind, visible: table.show_state(replace(shown, hidden=frozenset() if visible else frozenset((kind,))))
    )
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    assert "match" not in listed(table, Column.CLASS)
    assert len(listed(table)) == COUNT - matches
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    assert len(listed(table)) == COUNT


def test_typed_words_filter_at_once(qtbot: QtBot, table: TableView) -> None:
    qtbot.keyClicks(table.words, "270")
    assert listed(table) == ["27"]
    table.words.clear()
    assert len(listed(table)) == COUNT


def test_a_click_in_a_sorted_table_picks_the_reading_of_that_row(qtbot: QtBot, table: TableView) -> None:
    click_header(qtbot, table, Column.HEADING)
    click_header(qtbot, table, Column.HEADING)
    table.view.scrollToTop()
    with qtbot.waitSignal(table.gestures.picked, timeout=PATIENCE) as picked:
        click_row(qtbot, table, 2)
    assert picked.args == [int(listed(table)[2])]


def test_up_and_down_pick_the_next_row(qtbot: QtBot, table: TableView) -> None:
    with qtbot.waitSignal(table.gestures.picked, timeout=PATIENCE) as picked:
        qtbot.keyClick(table.view, Qt.Key.Key_Up)
    assert picked.args == [COUNT - 2]


def test_the_chosen_reading_is_selected_and_visible_without_picking(
    qtbot: QtBot, table: TableView, shown: Shown
) -> None:
    with qtbot.assertNotEmitted(table.gestures.picked):
        table.show_state(replace(shown, chosen=4))
    assert [index.row() for index in table.view.selectionModel().selectedRows()] == [4]
    assert table.view.viewport().rect().intersects(table.view.visualRect(table.model.index(4, 0)))


def test_the_chosen_reading_stays_visible_when_the_table_shrinks(qtbot: QtBot, table: TableView, shown: Shown) -> None:
    table.show_state(replace(shown, chosen=20))
    table.resize(900, 110)
    chosen = table.view.currentIndex()
    until(qtbot, lambda: table.view.viewport().rect().contains(table.view.visualRect(chosen).center()))
    assert chosen.row() == 20


def test_a_growing_scan_is_followed_without_picking(qtbot: QtBot, shown: Shown) -> None:
    table = TableView()
    qtbot.addWidget(table)
    table.resize(900, 200)
    with qtbot.assertNotEmitted(table.gestures.picked):
        for count in range(1, COUNT + 1):
            table.show_state(replace(shown, readings=shown.readings[:count], chosen=count - 1))
            assert table.view.currentIndex().row() == count - 1
        table.show_state(replace(shown, readings=shown.readings[:5], chosen=4))
    assert listed(table) == [str(k) for k in range(5)]


def test_copy_takes_the_selected_rows_or_all_listed_ones(qtbot: QtBot, table: TableView) -> None:
    table.words.setText("match")
    qtbot.mouseClick(table.copy, Qt.MouseButton.LeftButton)
    copied = list(csv.DictReader(io.StringIO(QGuiApplication.clipboard().text())))
    assert [row["number"] for row in copied] == listed(table)
    click_row(qtbot, table, 0)
    place = table.view.visualRect(table.model.index(2, Column.HEADING)).center()
    qtbot.mouseClick(table.view.viewport(), Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ShiftModifier, pos=place)
    table.view.setFocus()
    qtbot.keyClick(table.view, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    copied = list(csv.DictReader(io.StringIO(QGuiApplication.clipboard().text())))
    assert [row["number"] for row in copied] == listed(table)[:3]


def test_outdated_predicted_values_are_grey_and_measured_values_are_not(table: TableView, shown: Shown) -> None:
    def inks() -> list[str]:
        cells = [table.model.index(0, column) for column in Column]
        brushes = [table.model.data(cell, Qt.ItemDataRole.ForegroundRole) for cell in cells]
        return ["" if brush is None else brush.color().name() for brush in brushes]

    grey = QColor(shown.look.palette.faint).name()
    count = table.classes[Kind.MATCH]
    for outdated, ink in ((True, grey), (False, "")):
        table.show_state(replace(shown, outdated=outdated))
        assert inks() == ["" if column < Column.PREDICTED or column is Column.NOTE else ink for column in Column]
        assert (count.palette().buttonText().color().name() == grey) is outdated


@pytest.mark.parametrize(
    ("width", "unit", "left_out"),
    [
        (430, LengthUnit.M, {Column.NUMBER, Column.PREDICTED, Column.SENTENCE}),  # on a small screen, beside a panel
        (430, LengthUnit.FT, {Column.PREDICTED, Column.SENTENCE}),
        (590, LengthUnit.M, {Column.SENTENCE}),  # on a small screen
        (590, LengthUnit.CM, {Column.SENTENCE}),
        (870, LengthUnit.M, set()),  # on a large one
    ],
)
def test_only_paths_and_sentences_are_cut_off_without_horizontal_scrolling(
    qtbot: QtBot, table: TableView, shown: Shown, width: int, unit: LengthUnit, left_out: set[Column]
) -> None:
    table.show_state(replace(shown, look=Look(unit=unit)))
    left_out = left_out | {Column.NOTE}  # there are no notes
    click_header(qtbot, table, Column.RESIDUAL)
    for pixels in (300, 1500, 300, width):
        table.resize(pixels, 200)
    view, header = table.view, table.view.horizontalHeader()
    until(qtbot, lambda: view.viewport().width() > width - 40)
    assert view.horizontalScrollBar().maximum() == 0
    assert {column for column in Column if view.isColumnHidden(column)} == left_out
    assert header.sortIndicatorSection() == Column.RESIDUAL
    assert view.columnWidth(Column.PATH) >= view.fontMetrics().horizontalAdvance("bottom>top")
    for column in (column for column in Column if column < Column.PATH and column not in left_out):
        room = view.columnWidth(column) - 8
        name = table.model.headerData(column, Qt.Orientation.Horizontal)
        assert header.fontMetrics().horizontalAdvance(name) + 14 * (column is Column.RESIDUAL) <= room
        mark = 20 if column is Column.CLASS else 0
        assert max(map(view.fontMetrics().horizontalAdvance, listed(table, column))) + mark <= room


def test_the_class_of_readings_without_a_room_is_not_cut_off(table: TableView, shown: Shown) -> None:
    table.show_state(replace(shown, scene=replace(shown.scene, room=None), compared=None))
    word = table.view.fontMetrics().horizontalAdvance("measured")
    assert table.view.columnWidth(Column.CLASS) >= word + 20 + 8


def test_units_follow_the_look(table: TableView, shown: Shown) -> None:
    table.show_state(replace(shown, look=Look(unit=LengthUnit.FT)))
    names = [table.model.headerData(column, Qt.Orientation.Horizontal) for column in Column]
    assert "measured (ft)" in names
    assert "residual (in)" in names
    measured = shown.readings[27].range
    assert listed(table, Column.MEASURED)[27] == f"{measured / 0.3048:.2f}"


@pytest.mark.parametrize(("room", "name"), [(False, "measured"), (True, "not compared")])
def test_readings_that_are_not_compared_are_listed_as_such(qtbot: QtBot, shown: Shown, room: bool, name: str) -> None:
    table = TableView()
    qtbot.addWidget(table)
    scene = shown.scene if room else replace(shown.scene, room=None, place=None)
    table.show_state(replace(shown, compared=None, scene=scene))
    assert set(listed(table, Column.CLASS)) == {name}
    kind = Unclassed.WAITING if room else Unclassed.MEASURED
    assert table.classes[kind].text() == f"{COUNT} {name}"


def test_sentences_are_computed_only_for_visible_rows(
    qtbot: QtBot, shown: Shown, monkeypatch: pytest.MonkeyPatch
) -> None:
    computed: set[int] = set()
    explain = Shown.sentence_of
    monkeypatch.setattr(Shown, "sentence_of", lambda shown, index: computed.add(index) or explain(shown, index))
    table = TableView()
    qtbot.addWidget(table)
    table.resize(1400, 300)
    many = shown.readings * (LONG // len(shown.readings))
    table.show_state(replace(shown, readings=many, chosen=len(many) - 1))
    with qtbot.waitExposed(table, timeout=PATIENCE):
        table.show()
    table.view.viewport().repaint()
    assert 0 < len(computed) < 100
