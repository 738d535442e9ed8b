from .results import read_study as read_study
from .results import read_tables as read_tables
from .spec import load_study as load_study
from .study_run import run_study as run_study
