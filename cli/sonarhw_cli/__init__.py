"""The command line of sonarhw, one file for each command.

The commands are the public interface. This package has no public names: all modules may change.
"""
