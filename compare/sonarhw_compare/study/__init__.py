"""Studies: many predicted scans over grids and random draws, from a TOML file to a folder of Parquet.

from sonarhw_compare.study import load_study, read_study, run_study

run_study(load_study(Path("study.toml")), Path("results"))
results = read_study("results")  # an xarray.Dataset
"""

from sonarhw_compare.study.results import read_study, read_tables
from sonarhw_compare.study.spec import load_study
from sonarhw_compare.study.study_run import run_study

__all__ = ["load_study", "read_study", "read_tables", "run_study"]
