"""No test of this folder leaves a thread or an open file."""

import pytest


@pytest.fixture(autouse=True)
def nothing_remains_of_any_test(nothing_remains: None) -> None:
    """Check each test."""
