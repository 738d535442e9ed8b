"""The instrument, the prediction and the comparison know no Qt, and the window loads nothing in vain."""

import pkgutil
import subprocess
import sys

import compare
import sim
import sonarhw


def test_sonarhw_sim_and_compare_import_no_qt() -> None:
    modules = [
        info.name
        for package in (sonarhw, sim, compare)
        for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    ]
    assert len(modules) > 20
    script = f"import sys; [__import__(name) for name in {modules}]; print([m for m in sys.modules if 'PySide' in m])"
    told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[]"


def test_the_window_opens_without_what_only_some_pictures_need() -> None:
    script = "import sys, gui.app, cli.gui; print([m for m in sys.modules if m.split('.')[0] == 'matplotlib'])"
    told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[]"


def test_the_parts_without_widgets_import_no_qt() -> None:
    modules = [
        "forecast",
        "worker",
        "playback",
        "live_scan",
        "scene",
        "shown",
        "chosen_trace",
        "bscan_request",
        "trace_forecast",
        "status",
        "choice",
        "rate",
        "live_device",
        "live_feed",
        "notices",
        "reading_rows",
        "device_words",
        "grips",
        "plan_geometry",
        "plan_words",
        "room_edit",
        "scene_edit",
        "fit_scene",
        "pixels",
        "recordings",
        "svg_strokes",
    ]
    script = (
        f"import sys; [__import__('gui.' + m) for m in {modules}]; print([m for m in sys.modules if 'PySide' in m])"
    )
    told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[]"
