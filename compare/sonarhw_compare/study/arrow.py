"""Apache Arrow for the tables of a study, installed only with the extra `study` because of its size."""

from sonarhw.errors import InputError

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
except ModuleNotFoundError as error:
    raise InputError("studies need pyarrow, which is not installed: pip install 'sonarhw[study]'") from error

__all__ = ["pa", "pq"]
