"""`sonarhw locate`: find the pose of a scan in a known room."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from sonarhw_compare.match import explains_few, few_explained
from sonarhw_compare.pictures import PICTURES
from sonarhw_compare.scans import estimate_degrees

from sonarhw_cli.console.lines import print_json, print_line, warn
from sonarhw_cli.console.log_input import LogFile, open_in_room
from sonarhw_cli.console.number_format import deviation_text, estimate_text
from sonarhw_cli.console.options import PICTURE_FILE, BoardOfLog, Force, ReceiverChoice, RoomOfLog
from sonarhw_cli.console.output import checked_out, write_figure
from sonarhw_cli.console.progress import progress_of_share

if TYPE_CHECKING:
    from sonarhw_compare.locate import Located, Pose
    from sonarhw_sim.room.room import Place

_ANY_HEADING = math.radians(90)  # standard deviation above which the heading counts as unknown
_CONTRADICTION = 4.0  # standard deviations between the heading of --heading and the one found
_RIVAL = 0.25  # a second pose with more than this share of the first's probability makes the answer ambiguous


Height = Annotated[
    float | None,
    typer.Option(help="Height of the transducer, metres; the prediction then includes floor and ceiling.", metavar="M"),
]
NearPlace = Annotated[
    float, typer.Option(help="Distance within which a pose counts as a place of the room, metres.", min=0)
]
KnownHeading = Annotated[
    float | None, typer.Option("--heading", help="Known heading of turntable step 0, degrees.", metavar="DEG")
]
HeadingDeviation = Annotated[
    float, typer.Option("--heading-sd", help="Standard deviation of --heading, degrees; 0 is exact.", min=0)
]


def locate(
    log_file: LogFile,
    room_name: RoomOfLog = None,
    board: BoardOfLog = None,
    receiver: ReceiverChoice = None,
    height: Height = None,
    heading: KnownHeading = None,
    heading_sd: HeadingDeviation = 5.0,
    near: NearPlace = 0.1,
    out: Annotated[Path | None, typer.Option(help="Draw the posterior in the plan.", metavar=PICTURE_FILE)] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the poses as JSON.")] = False,
    force: Force = False,
) -> None:
    """Find the pose of a scan in a known room. Each possible pose is printed with its probability."""
    if out is not None:
        checked_out(out, PICTURES, force, log_file, room_name, board)
    scan, room, chosen = open_in_room(log_file, room_name, board)
    from sonarhw_compare.locate import known_heading, locate_scan
    from sonarhw_sim.predict.prediction import PredictionOptions

    prediction = PredictionOptions(receiver=receiver)
    expected, spread = known_heading(None if heading is None else math.radians(heading), math.radians(heading_sd))
    with progress_of_share() as show:
        located = locate_scan(
            scan.readings,
            room,
            chosen,
            prediction=prediction,
            height=height,
            expected=expected,
            spread=spread,
            tick=lambda share: show(share, "locating"),
        )
    if out is not None:
        from sonarhw_compare.drawings import draw_located

        write_figure(out, draw_located(located), force)
    if as_json:
        print_json(_figures(located, near))
    else:
        for line in _lines(located, near):
            print_line(line)
    echoes = sum(reading.range is not None for reading in located.readings)
    few = few_explained(str(log_file), located.explained, echoes, located=True)
    turned = () if expected is None else _heading_doubts(located.poses[0], expected.heading, spread.heading)
    for doubt in (*few, *(f"{log_file}: {doubt}" for doubt in (*located.doubts, *turned))):
        warn(doubt)


def _heading_doubts(pose: "Pose", stated: float, deviation: float) -> tuple[str, ...]:
    """Return a warning if a pose contradicts the stated heading, rad, with this standard deviation, rad."""
    away = abs(math.remainder(pose.heading - stated, math.tau))
    if away <= _CONTRADICTION * math.hypot(deviation, pose.deviations[2]):
        return ()
    return (
        f"step 0 of the first pose is {math.degrees(away):.0f}° from --heading, which is unlikely with this "
        "--heading-sd; check both",
    )


def _figures(located: "Located", near: float) -> dict[str, Any]:
    places = located.places(near)
    return {
        "poses": [_figures_of(pose, _place_near(located, pose, near)) for pose in located.poses],
        "place": _likely_place(places),
        "places": {name: round(share, 6) for name, share in places.items()},
        "readings_alike": round(located.redundancy, 3),
        "explained": round(located.explained, 6),
        "fits_room": not explains_few(located.explained),
    }


def _place_near(located: "Located", pose: "Pose", near: float) -> "Place | None":
    return located.room.places.get(located.place_near(pose, near) or "")


def _likely_place(places: dict[str, float]) -> str | None:
    """Return the most probable of the room's places; None if none is possible."""
    best = max(places, key=places.__getitem__, default=None)
    return best if best is not None and places[best] > 0 else None


def _heading_degrees(pose: "Pose", place: "Place | None") -> float:
    """Return the heading of a pose, degrees, on the same turn as that of its place."""
    return estimate_degrees(pose.heading, 0.0 if place is None else place.heading, 6)


def _figures_of(pose: "Pose", place: "Place | None") -> dict[str, float | str | None]:
    dx, dy, turn = pose.deviations
    return {
        "x_m": round(pose.position[0], 6) + 0.0,
        "y_m": round(pose.position[1], 6) + 0.0,
        "heading_deg": _heading_degrees(pose, place),
        "offset_m": round(pose.offset, 6) + 0.0,
        "probability": round(pose.probability, 6),
        "place": None if place is None else place.name,
        "x_deviation_m": round(dx, 6),
        "y_deviation_m": round(dy, 6),
        "heading_deviation_deg": round(math.degrees(turn), 6) if turn <= _ANY_HEADING else None,
    }


def _lines(located: "Located", near: float) -> Iterator[str]:
    """Yield the lines to print: each pose, and whether the scan distinguishes them."""
    for pose in located.poses:
        yield _pose_line(pose, _place_near(located, pose, near))
    yield f"{located.explained:.0%} of the echoes are within 5 cm of an echo predicted for the first pose"
    first, *others = (pose.probability for pose in located.poses)
    if others and others[0] > _RIVAL * first:
        yield "the scan cannot distinguish these poses: the room looks nearly the same from them"
    places = located.places(near)
    if _likely_place(places) is not None:
        shares = ", ".join(f"{name} {share:.1%}" for name, share in places.items() if share >= 0.001)
        yield f"assuming one of the room's places: {shares}"


def _pose_line(pose: "Pose", place: "Place | None") -> str:
    dx, dy, _ = pose.deviations
    x, y = (estimate_text(at, spread) for at, spread in zip(pose.position, (dx, dy), strict=True))
    along_x, along_y = (deviation_text(spread * 1000, "") for spread in (dx, dy))
    offset = round(pose.offset * 1000)
    return (
        f"{pose.probability:6.1%}  at {x}, {y} m (± {along_x}, {along_y} mm), turntable step 0 at "
        f"{_heading_text(pose, place)}, range offset {f'{offset:+d}' if offset else '0'} mm"
        f"{'' if place is None else f'; {place.name}'}"
    )


def _heading_text(pose: "Pose", place: "Place | None") -> str:
    deviation = pose.deviations[2]
    if deviation > _ANY_HEADING:
        return "an unknown heading"
    degrees = math.degrees(deviation)
    return f"{estimate_text(_heading_degrees(pose, place), degrees)}° (± {deviation_text(degrees, '°')})"
