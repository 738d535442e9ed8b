"""Studies: many predicted scans over grids and random draws, from a TOML file to a folder of Parquet."""
