"""The instrument, the prediction and the comparison know no Qt, and the window loads nothing in vain."""

import pkgutil
import subprocess
import sys

import sonarhw_compare
import sonarhw_sim

import sonarhw


def test_sonarhw_sim_and_compare_import_no_qt() -> None:
    modules = [
        info.name
        for package in (sonarhw, sonarhw_sim, sonarhw_compare)
        for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    ]
    assert len(modules) > 20
    script = f"import sys; [__import__(name) for name in {modules}]; print([m for m in sys.modules if 'PySide' in m])"
    told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[]"


def test_the_window_opens_without_what_only_some_pictures_need() -> None:
    script = "import sys; import sonarhw_gui.shell.application, sonarhw_cli.window.gui_command; "
    script += "print([m for m in sys.modules if m.split('.')[0] == 'matplotlib'])"
    told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[]"


def test_the_parts_without_widgets_import_no_qt() -> None:
    modules = [
        "sonarhw_gui.work.forecast",
        "sonarhw_gui.work.worker",
        "sonarhw_gui.live.playback_speeds",
        "sonarhw_gui.live.live_scan",
        "sonarhw_gui.scene.scene",
        "sonarhw_gui.shown.shown",
        "sonarhw_gui.work.chosen_trace",
        "sonarhw_gui.work.bscan_request",
        "sonarhw_gui.session.trace_forecast",
        "sonarhw_gui.live.status",
        "sonarhw_gui.shown.choice",
        "sonarhw_gui.live.rate",
        "sonarhw_gui.live.live_device",
        "sonarhw_gui.live.live_feed",
        "sonarhw_gui.shown.notices",
        "sonarhw_gui.shown.reading_rows",
        "sonarhw_gui.live.device_words",
        "sonarhw_gui.scene.grips",
        "sonarhw_gui.scene.plan_geometry",
        "sonarhw_gui.plan.plan_words",
        "sonarhw_gui.scene.room_edit",
        "sonarhw_gui.scene.scene_edit",
        "sonarhw_gui.scene.fit_scene",
        "sonarhw_gui.parts.pixels",
        "sonarhw_gui.store.recordings",
        "sonarhw_gui.parts.svg_strokes",
    ]
    script = f"import sys; [__import__(m) for m in {modules}]; print([m for m in sys.modules if 'PySide' in m])"
    told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[]"
