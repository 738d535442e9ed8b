"""Apache Arrow for the tables of a study, installed only with the extra `study` because of its size.

It is imported when it is first used, so that `help(sonarhw)` and `from sonarhw import *` work without it.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from sonarhw.errors import MissingExtra

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq
else:

    class _OnFirstUse:
        """A module that is imported when one of its names is used. Raises MissingExtra if it is not installed."""

        def __init__(self, name: str) -> None:
            self._name = name

        def __getattr__(self, name: str) -> Any:
            try:
                return getattr(import_module(self._name), name)
            except ModuleNotFoundError as error:
                raise MissingExtra("studies need pyarrow", "study") from error

    pa, pq = _OnFirstUse("pyarrow"), _OnFirstUse("pyarrow.parquet")

__all__ = ["check_arrow", "pa", "pq"]


def check_arrow() -> None:
    """Raise MissingExtra if Arrow is not installed."""
    _ = pa.table, pq.write_table
