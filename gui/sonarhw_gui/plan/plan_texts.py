"""One-line descriptions of the object under the mouse in the plan: sensor, corner, wall, post or plain point."""

import math

from sonarhw_compare.edits import Point
from sonarhw_compare.scans import heading_text
from sonarhw_sim.room.room import Room

from sonarhw_gui.look.appearance import LengthUnit
from sonarhw_gui.scene.grips import Grip, GripPart, surface_at
from sonarhw_gui.scene.plan_geometry import decibels_text
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.scene.scene_edit import bearing
from sonarhw_gui.shown.shown import Shown


def text_under_pointer(shown: Shown, grip: Grip | None, at: Point, pixel: float) -> str:
    """Return one line about a point: the part that `grip` would drag, a wall or post, or the position of the point."""
    scene, unit = shown.scene, shown.look.unit
    place = point_text(at, unit)
    if grip is not None and grip.part is GripPart.SENSOR:
        return f"sensor, {pose_text(scene, unit)}; drag to move it"
    if grip is not None and grip.part is GripPart.BEAM:
        if shown.asked is not None:
            return f"beam of the question at {heading_text(shown.asked)}; drag to ask another heading"
        return f"beam, {pose_text(scene, unit)}; drag to turn it"
    if grip is not None and grip.part is GripPart.CORNER:
        return f"corner, {place}; drag to move it"
    room = scene.room
    surface = surface_at(room, at, pixel) if room else None
    if room is not None and surface is not None:
        return surface_text(room, surface)
    middle = scene.pose.position
    away = f"{unit.text(math.dist(middle, at))} at {heading_text(bearing(middle, at))} from the sensor"
    return f"{place} · {away}"


def surface_text(room: Room, surface: int) -> str:
    """Return name, material, reflectance and loss of a wall or post."""
    mirrored = float(room.reflectances[surface])
    loss = f" ({decibels_text(20 * math.log10(mirrored))})" if mirrored > 0 else ""
    power = mirrored**2 + float(room.scattered[surface]) ** 2
    scatters = f", scatters {float(room.scattered[surface]) ** 2 / power:.0%}" if room.scattered[surface] else ""
    material = room.materials[surface]
    upto = "up to " if material in room.tables else ""
    return f"{room.names[surface]} · {material}, reflectance {upto}{math.sqrt(power):.2f}{scatters}{loss}"


def point_text(at: Point, unit: LengthUnit) -> str:
    """Return the coordinates of a point in `unit`."""
    return f"x {unit.text(at[0])}, y {unit.text(at[1])}"


def pose_text(scene: Scene, unit: LengthUnit) -> str:
    """Return position and heading of the sensor, and whether it is outside the walls."""
    place = scene.pose
    outside = ", outside the walls" if scene.room and scene.room.is_outside(place.position) else ""
    return f"{point_text(place.position, unit)}{outside}, step 0 at {heading_text(place.heading)}"
