"""Only the window imports Qt, and it loads only modules that it needs."""

import importlib.util
import pkgutil
import subprocess
import sys

import pytest
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
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_the_window_opens_without_matplotlib() -> None:
    script = "import sys; import sonarhw_gui.shell.application, sonarhw_cli.window.gui_command; "
    script += "print([m for m in sys.modules if m.split('.')[0] == 'matplotlib'])"
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def modules_in(package: str) -> list[str]:
    """Return the names of all modules in a package."""
    found = importlib.util.find_spec(package)
    return [package, *(one.name for one in pkgutil.iter_modules(found.submodule_search_locations, f"{package}."))]


def loaded_by(package: str, unwanted: tuple[str, ...]) -> list[str]:
    """Return the first module of a package that loads one of the unwanted modules, directly or indirectly."""
    script = f"""
import sys
for name in {modules_in(package)}:
    __import__(name)
    if any(module.startswith({unwanted}) for module in sys.modules):
        print(name)
        break
"""
    return subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()


@pytest.mark.parametrize("folder", ["scene", "shown", "work", "live", "store"])
def test_the_folders_of_the_model_load_no_qt(folder: str) -> None:
    assert loaded_by(f"sonarhw_gui.{folder}", ("PySide6", "pyqtgraph")) == []


def test_the_session_loads_signals_and_timers_but_no_widgets() -> None:
    assert loaded_by("sonarhw_gui.session", ("PySide6.QtWidgets", "pyqtgraph")) == []


@pytest.mark.parametrize("module", ["sonarhw_gui.plan.plan_texts", "sonarhw_gui.parts.pixels"])
def test_texts_and_pixels_load_no_qt(module: str) -> None:
    script = f"import sys, {module}; print([m for m in sys.modules if 'PySide' in m])"
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
