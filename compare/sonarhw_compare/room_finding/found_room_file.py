"""The room file of a found room: walls, posts and places, with uncertainties and what is not known as comments."""

import math
from collections.abc import Sequence
from typing import Any

import tomlkit
from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.room import Room, parse_room
from tomlkit.items import AoT, Table

from sonarhw.errors import counted, harmless
from sonarhw.readings import FloatArray
from sonarhw_compare.headings import in_degrees
from sonarhw_compare.locate.poses import Pose
from sonarhw_compare.room_finding.draft import MATERIAL, post_name, wall_name
from sonarhw_compare.room_finding.evidence import REFLECTANCE
from sonarhw_compare.room_finding.right_angles import SHARE, SPREAD, at_right_angles
from sonarhw_compare.room_finding.room_search import FoundRoom
from sonarhw_compare.room_finding.unknown_poses import PlacedRoom

_DIGITS = 5  # of metres


def found_room_text(placed: PlacedRoom, board: Board) -> str:
    """Return the text of a room file with the found walls, posts and places."""
    found, file = placed.found, tomlkit.document()
    for line in _header(placed, board):
        file.add(tomlkit.comment(line))
    file["name"] = "Found room"
    material = tomlkit.table()
    material["reflectance"] = REFLECTANCE
    material["reflectance"].comment("assumed; `sonarhw fit --free reflectance` finds it")
    file["materials"] = tomlkit.table(is_super_table=True).append(MATERIAL, material)
    file["walls"] = _array([_wall(found, number, key) for number, key in enumerate(found.draft.walls)])
    if found.draft.posts:
        file["posts"] = _array([_post(found, row) for row in range(len(found.draft.posts))])
    places = tomlkit.table(is_super_table=True)
    for number, name in enumerate(_place_names(placed)):
        places[name] = _place(found, number)
    file["places"] = places
    return tomlkit.dumps(file)


def found_room(placed: PlacedRoom, board: Board) -> Room:
    """Return the room of `found_room_text`."""
    return parse_room(found_room_text(placed, board), "the found room")


def found_room_figures(found: FoundRoom) -> dict[str, Any]:
    """Return walls, posts and open ends for JSON, in metres and degrees."""
    return {
        "echoes": found.echoes,
        "explained": found.explained,
        "offset_m": round(found.draft.offset, _DIGITS),
        "offset_sd_m": found.offset_deviation,
        "threshold_higher_db": found.draft.threshold_db,
        "threshold_sd_db": found.threshold_deviation,
        "right_angled": at_right_angles(found.draft),
        "walls": [
            {
                "points_m": [[x, y], [x2, y2]],
                "across_sd_m": _deviation(found, "wall", key, 0),
                "angle_sd_deg": math.degrees(_deviation(found, "wall", key, 1)),
                "touches": len(found.touches.walls[key]),
            }
            for key in found.draft.walls
            for x, y, x2, y2 in [_rounded(found.draft.segment(key))]
        ],
        "posts": [
            {
                "center_m": _rounded(post.center),
                "radius_m": round(post.radius, _DIGITS),
                "center_sd_m": [_deviation(found, "post", row, part) for part in (0, 1)],
                "radius_sd_m": _deviation(found, "post", row, 2),
                "touches": found.touches.posts[row],
            }
            for row, post in enumerate(found.draft.posts)
        ],
        "open_ends_m": [_rounded(end) for end in open_ends(found)],
    }


def pose_text(pose: Pose) -> str:
    """Return one possible pose of a located scan with its probability."""
    x, y = pose.position
    return f"{pose.probability:.1%} at {x:.3f}, {y:.3f} m, turntable step 0 at {in_degrees(pose.heading, 1):.1f}°"


def assumptions(found: FoundRoom, board: Board) -> list[str]:
    """Return a line for each value that was expected to be near a known one, and what was found."""
    of, walls = at_right_angles(found.draft), len(found.draft.walls)
    lines = [
        f"assumed that {SHARE:.0%} of the walls are parallel or at right angles within {math.degrees(SPREAD):.0f}°; "
        f"{of} of {walls} are"
    ]
    if found.offset_deviation is not None:
        lines.append(
            f"range offset of the sensor: {found.draft.offset * 1000:.0f} ± {found.offset_deviation * 1000:.0f} mm "
            f"beside that of board {board.name!r}; 0 ± {board.range_sd * 1000:.0f} mm was expected (its range_sd)"
        )
    if found.threshold_deviation is not None:
        lines.append(
            f"threshold of the sensor: {found.draft.threshold_db:+.1f} ± {found.threshold_deviation:.1f} dB beside "
            f"that of board {board.name!r}; 0 ± {board.threshold_sd_db:.1f} dB was expected (its threshold_sd_db)"
        )
    return lines


def open_ends(found: FoundRoom) -> list[tuple[float, float]]:
    """Return the ends of walls (m) beyond which the scans show nothing."""
    ends = []
    for key in found.draft.walls:
        x, y, x2, y2 = found.draft.segment(key).tolist()
        ends += [at for which, at in enumerate(((x, y), (x2, y2))) if found.draft.is_free(key, which)]
    return ends


def _header(placed: PlacedRoom, board: Board) -> list[str]:
    found, scans = placed.found, placed.scans
    lines = [
        f"Found by `sonarhw map` in {counted(len(scans), 'scan')} with board {board.name!r}: "
        + ", ".join(harmless(scan.title) for scan in scans),
        f"{found.explained} of {found.echoes} echoes are within 5 cm of one that this room predicts.",
        "± is one standard deviation. Surfaces that returned no echo to any scan are missing.",
    ]
    lines += [f"{line[0].upper()}{line[1:]}." for line in assumptions(found, board)]
    ends = ", ".join(f"({x:.2f}, {y:.2f})" for x, y in open_ends(found))
    if ends:
        lines.append(f"The walls may continue beyond these points (m): {ends}")
    for title, poses in placed.poses.items():
        lines.append(f"Possible poses of {harmless(title)}: {'; '.join(map(pose_text, poses))}")
    lines += [f"Left out, because its pose was not found: {harmless(title)}" for title in placed.left_out]
    return lines


def _place_names(placed: PlacedRoom) -> list[str]:
    """Return a name for the place of each scan, with a number behind a name that another one has already."""
    names: list[str] = []
    for scan, place in zip(placed.scans, placed.found.draft.places, strict=True):
        name, number = scan.name or place.name, 2
        while name in names:
            name, number = f"{scan.name or place.name}-{number}", number + 1
        names.append(name)
    return names


def _place(found: FoundRoom, number: int) -> Table:
    table, place = tomlkit.table(), found.draft.places[number]
    table["position"] = _point(place.position)
    table["heading_deg"] = round(math.degrees(place.heading), 4) + 0.0
    deviations = {move.part: by for move, by in found.deviations.items() if move.is_of("place", number)}
    if 0 in deviations:  # else it is exact
        x, y = (deviations[part] * 1000 for part in (0, 1))
        table["position"].comment(f"± {x:.1f} mm in x, ± {y:.1f} mm in y")
    if 2 in deviations:
        table["heading_deg"].comment(f"± {math.degrees(deviations[2]):.2f}°")
    return table


def _wall(found: FoundRoom, number: int, key: int) -> Table:
    across, turned = (_deviation(found, "wall", key, part) for part in (0, 1))
    table = tomlkit.table()
    table["name"] = wall_name(number)
    table["edges"] = [wall_name(number)]  # not "wall 1[0]" in `via`
    x, y, x2, y2 = found.draft.segment(key).tolist()
    points = tomlkit.array()
    points.extend([_point((x, y)), _point((x2, y2))])
    table["points"] = points
    touched = len(found.touches.walls[key])
    table["points"].comment(f"± {across * 1000:.1f} mm across, ± {math.degrees(turned):.2f}°; {touched} touches")
    table["material"] = MATERIAL
    return table


def _post(found: FoundRoom, row: int) -> Table:
    post = found.draft.posts[row]
    x, y, radius = (_deviation(found, "post", row, part) * 1000 for part in range(3))
    table = tomlkit.table()
    table["name"] = post_name(row)
    table["center"] = _point(post.center)
    table["center"].comment(f"± {x:.1f} mm, ± {y:.1f} mm; {found.touches.posts[row]} touches")
    table["radius"] = round(post.radius, _DIGITS)
    table["radius"].comment(f"± {radius:.1f} mm")
    table["material"] = MATERIAL
    return table


def _deviation(found: FoundRoom, what: str, which: int, part: int) -> float:
    return next(
        deviation
        for move, deviation in found.deviations.items()
        if (move.what, move.which, move.part) == (what, which, part)
    )


def _point(point: Sequence[float]) -> tomlkit.items.Array:
    array = tomlkit.array()
    array.extend(_rounded(point))
    return array


def _rounded(values: Sequence[float] | FloatArray) -> list[float]:
    return [round(float(at), _DIGITS) + 0.0 for at in values]


def _array(tables: Sequence[Table]) -> AoT:
    return AoT(list(tables))
