"""Apache Arrow for the tables of a study. It is large, so it is installed with the extra `study` only."""

from sonarhw.errors import InputError

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
except ModuleNotFoundError as error:
    raise InputError("studies need pyarrow, which is not installed: pip install 'sonarhw[study]'") from error

__all__ = ["pa", "pq"]
