"""List of the packages in the wheel: every folder of code, and rooms/ as `sonarhw_rooms`."""

from setuptools import find_packages, setup

FOLDERS = (".", "sim", "compare", "gui", "cli")

setup(packages=["sonarhw_rooms", *(name for folder in FOLDERS for name in find_packages(folder, include=["sonarhw*"]))])
