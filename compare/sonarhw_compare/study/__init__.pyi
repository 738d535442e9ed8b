from .results import read_study, read_tables
from .spec import load_study
from .study_run import run_study

__all__ = [
    "load_study",
    "read_study",
    "read_tables",
    "run_study",
]
