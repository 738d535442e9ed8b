"""The folder of the checkout, for tests that read its rooms, documents and firmware."""

from pathlib import Path

CHECKOUT = Path(__file__).parents[1]
