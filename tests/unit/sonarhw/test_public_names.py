"""Every public name of the package can be imported and is listed in its docstring."""

import pydoc
import sys

import pytest
from sonarhw_compare.study import check_arrow

import sonarhw
from sonarhw.errors import MissingExtra


def test_every_public_name_can_be_imported() -> None:
    assert all(getattr(sonarhw, name).__name__ == name for name in sonarhw.__all__ if name != "PluginScanner")
    assert sonarhw.PluginScanner is sonarhw.Scanner  # deprecated


def test_every_public_name_is_listed_in_the_package_docstring() -> None:
    assert all(f"`{name}`" in sonarhw.__doc__ for name in sonarhw.__all__)


def test_an_unknown_name_raises_attribute_error() -> None:
    assert not hasattr(sonarhw, "Sonar")


def test_help_works_without_the_extra_study(monkeypatch: pytest.MonkeyPatch) -> None:
    # pydoc gets every name; a name that raises anything but AttributeError would end it
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert "run_study" in pydoc.render_doc(sonarhw)
    with pytest.raises(MissingExtra, match="pip install"):
        check_arrow()
