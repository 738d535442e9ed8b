"""Studies: many predicted scans over grids and random draws, from a TOML file to a folder of Parquet files.

from sonarhw_compare.study import load_study, read_study, run_study

run_study(load_study(Path("study.toml")), Path("results"))
results = read_study("results")  # an xarray.Dataset

This package needs the extra `study`: pip install '.[study]' in the source folder.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
