"""`python -m sonarhw`: the command `sonarhw`."""

from importlib import import_module

if __name__ == "__main__":
    # by name: this package is the lowest layer, and the command line the highest
    import_module("sonarhw_cli.entry").main()
