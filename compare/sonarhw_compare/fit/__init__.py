"""Fit: the place, room and board that explain measured scans best, and how certain they are.

`values` has the quantities, parameters and results, `likelihood` the probability of readings, `search` the way to its
maximum and the posterior; `fitting` runs a whole fit. `plain_fit` is the search of `compare --fit`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
