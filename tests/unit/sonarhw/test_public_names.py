"""Every public name of the package can be imported and is listed in its docstring."""

import sonarhw


def test_every_public_name_can_be_imported() -> None:
    assert all(getattr(sonarhw, name).__name__ == name for name in sonarhw.__all__)


def test_every_public_name_is_listed_in_the_package_docstring() -> None:
    assert sonarhw.__doc__ is not None
    assert all(f"`{name}`" in sonarhw.__doc__ for name in sonarhw.__all__)


def test_an_unknown_name_raises_attribute_error() -> None:
    assert not hasattr(sonarhw, "Sonar")
