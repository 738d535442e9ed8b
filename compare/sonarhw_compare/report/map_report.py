"""The HTML report about a found room, with certainty grid and regions of constant depth beside it as the baseline."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from importlib.metadata import version
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.room import Room

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.map.map_picture import draw_map
from sonarhw_compare.map.room_map import Layer, RoomMap
from sonarhw_compare.pictures.picture_file import picture_bytes
from sonarhw_compare.report.found_room_picture import draw_found_room
from sonarhw_compare.report.html_parts import escaped, facts_table, html_page, picture, table_head, table_row
from sonarhw_compare.room_finding.found_room_file import found_room_figures, open_ends
from sonarhw_compare.room_finding.room_search import FoundRoom


@dataclass(frozen=True)
class MapReport:
    """The content of a report about a found room."""

    found: FoundRoom
    room: Room  # of the file
    scans: tuple[PlacedScan, ...]  # at the places of the found room
    board: Board
    baseline: RoomMap
    known: Room | None = None  # the room file that the logs contain
    lines: Sequence[str] = ()  # what else the command prints about the room
    doubts: Sequence[str] = ()


def map_report_html(report: MapReport) -> str:
    """Return the page."""
    return html_page("Found room", _body(report))


def _body(report: MapReport) -> Iterator[str]:
    found, figures = report.found, found_room_figures(report.found)
    yield f"<h1>Room found from {len(report.scans)} scans</h1>"
    yield f"<p>{escaped(', '.join(scan.title for scan in report.scans))}</p>"
    yield (
        f'<p class="lead">{found.explained} of {found.echoes} echoes are within 5 cm of one that the found room '
        "predicts.</p>"
    )
    for doubt in report.doubts:
        yield f"<p><strong>Warning:</strong> {escaped(doubt)}.</p>"
    ends = open_ends(found)
    drawn = draw_found_room(report.scans, report.room, report.board, ends, report.known)
    yield "<h2>The found room</h2>"
    yield _drawn(".svg", drawn, "Echoes, found room, and the room file of the logs")
    yield from _walls(figures["walls"])
    yield from _posts(figures["posts"])
    yield _open_ends(ends)
    for line in report.lines:
        yield f"<p>{escaped(line)}</p>"
    yield "<h2>Baseline: certainty grid and regions of constant depth</h2>"
    yield _drawn(".png", draw_map(report.baseline, report.known), "Certainty grid, arcs, walls, corners and edges")
    yield from _beside(report)
    yield "<h2>Made with</h2>"
    yield facts_table((("board", report.board.name), ("sonarhw", version("sonarhw")), ("NumPy", version("numpy"))))
    yield f"<details><summary>The room file</summary><pre>{escape(report.room.text)}</pre></details>"


def _walls(walls: Iterable[dict[str, Any]]) -> Iterator[str]:
    yield from table_head("surfaces", ("wall", "from (m)", "to (m)", "across ± (mm)", "angle ± (°)", "touches"))
    for number, wall in enumerate(walls, 1):
        start, end = wall["points_m"]
        errors = f"{wall['across_sd_m'] * 1000:.1f}", f"{wall['angle_sd_deg']:.2f}"
        yield table_row((f"wall {number}", _point(start), _point(end), *errors, str(wall["touches"])))
    yield "</tbody></table>"


def _posts(posts: Sequence[dict[str, Any]]) -> Iterator[str]:
    if not posts:
        return
    yield from table_head("surfaces", ("post", "centre (m)", "radius (mm)", "touches"))
    for number, post in enumerate(posts, 1):
        radius = f"{post['radius_m'] * 1000:.0f}"
        yield table_row((f"post {number}", _point(post["center_m"]), radius, str(post["touches"])))
    yield "</tbody></table>"


def _open_ends(ends: Sequence[tuple[float, float]]) -> str:
    if not ends:
        return "<p>No wall has an open end.</p>"
    return (
        f"<p>Beyond these open ends (m), the scans show nothing: {', '.join(f'({_point(end)})' for end in ends)}.</p>"
    )


def _beside(report: MapReport) -> Iterator[str]:
    """Yield a table of what the found room and the baseline contain."""
    yield from table_head("surfaces", ("", "walls", "their length (m)", "posts", "corners", "edges"))
    walls = report.room.walls
    whole = _length(walls[:, 2:] - walls[:, :2])
    yield table_row(("found room", str(len(walls)), f"{whole:.2f}", str(len(report.room.posts)), "", ""))
    layers = [("baseline, all echoes", report.baseline.plain)]
    if report.baseline.followed_room is not None:
        layers.append(("baseline, without echoes by several reflections", report.baseline.direct))
    for name, layer in layers:
        yield table_row((name, *_counts(layer)))
    yield "</tbody></table>"


def _counts(layer: Layer) -> tuple[str, ...]:
    walls, points = layer.features.walls, layer.features.points
    whole = _length(np.array([np.subtract(wall.end, wall.start) for wall in walls]).reshape(-1, 2))
    corners = sum(point.is_corner for point in points)
    return str(len(walls)), f"{whole:.2f}", "", str(corners), str(len(points) - corners)


def _length(along: FloatArray) -> float:
    return float(np.hypot(*along.T).sum())


def _point(at: Sequence[float]) -> str:
    return f"{at[0]:.3f}, {at[1]:.3f}"


def _drawn(suffix: str, figure: Figure, meaning: str) -> str:
    return picture(suffix, picture_bytes(figure, suffix), meaning)
