"""The public faces of the packages: every name resolves, is documented and typed."""

import ast
import inspect
import pydoc
import sys
from importlib import import_module
from pathlib import Path

import pytest
from sonarhw_compare.study import check_arrow

import sonarhw
from sonarhw.errors import MissingExtra

LAZY = ("sonarhw", "sonarhw_sim", "sonarhw_compare", "sonarhw_compare.fit")
NAMES = [(package, name) for package in (*LAZY, "sonarhw_compare.study") for name in import_module(package).__all__]


@pytest.mark.parametrize(("package", "name"), NAMES)
def test_a_public_name_resolves_and_is_documented_and_typed(package: str, name: str) -> None:
    found = getattr(import_module(package), name)
    if not callable(found):
        assert name.isupper()  # a constant, which its module types
        return
    assert inspect.getdoc(found)
    if inspect.isfunction(found):
        signature = inspect.signature(found)
        assert signature.return_annotation is not signature.empty
        assert all(one.annotation is not one.empty for one in signature.parameters.values())


def test_every_public_name_is_in_the_docstring_and_the_help(monkeypatch: pytest.MonkeyPatch) -> None:
    assert all(f"`{name}`" in sonarhw.__doc__ for name in sonarhw.__all__)
    assert sonarhw.PluginScanner is sonarhw.Scanner  # deprecated
    assert not hasattr(sonarhw, "Sonar")
    # pydoc gets every name; a name that raises anything but AttributeError would end it
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert "run_study" in pydoc.render_doc(sonarhw)
    with pytest.raises(MissingExtra, match="pip install"):
        check_arrow()


@pytest.mark.parametrize("package", LAZY)
def test_the_stub_lists_every_name_once(package: str) -> None:
    module = import_module(package)
    stub = ast.parse(Path(module.__file__).with_suffix(".pyi").read_text())
    listed = next(ast.literal_eval(one.value) for one in stub.body if isinstance(one, ast.Assign))
    assert sorted(listed) == list(module.__all__)
    assert len(set(listed)) == len(listed)
