"""Only the window imports Qt, and it loads only modules that it needs."""

import importlib.util
import pkgutil
import subprocess
import sys

import sonarhw_compare
import sonarhw_sim

import sonarhw

MODEL = ("sonarhw_gui.model.scene", "sonarhw_gui.model.edits", "sonarhw_gui.model.look")


def test_sonarhw_sim_compare_and_the_model_of_the_window_load_no_qt() -> None:
    modules = [
        info.name
        for package in (sonarhw, sonarhw_sim, sonarhw_compare)
        for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    ]
    modules += MODEL
    assert len(modules) > 50
    assert first_that_loads(modules, ("PySide6", "pyqtgraph")) == []


def test_the_window_opens_without_matplotlib() -> None:
    script = "import sys; import sonarhw_gui.window.start, sonarhw_cli.window; "
    script += "print([m for m in sys.modules if m.split('.')[0] == 'matplotlib'])"
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def modules_in(package: str) -> list[str]:
    """Return the names of all modules in a package."""
    found = importlib.util.find_spec(package)
    return [package, *(one.name for one in pkgutil.iter_modules(found.submodule_search_locations, f"{package}."))]


def first_that_loads(modules: list[str], unwanted: tuple[str, ...]) -> list[str]:
    """Return the first of these modules that loads one of the unwanted modules, directly or indirectly."""
    script = f"""
import sys
for name in {modules}:
    __import__(name)
    if any(module.startswith({unwanted}) for module in sys.modules):
        print(name)
        break
"""
    return subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()


def test_the_session_loads_signals_and_timers_but_no_widgets() -> None:
    assert first_that_loads(modules_in("sonarhw_gui.session"), ("PySide6.QtWidgets", "pyqtgraph")) == []
