"""List of the packages in the wheel: every folder of code, rooms/ and examples/, and the manual page."""

from setuptools import find_packages, setup

FOLDERS = (".", "sim", "compare", "gui", "cli")

DATA = ("sonarhw_rooms", "sonarhw_examples")

setup(
    packages=[*DATA, *(name for folder in FOLDERS for name in find_packages(folder, include=["sonarhw*"]))],
    data_files=[("share/man/man1", ["docs/reference/sonarhw.1"])],
)
