"""Fit of place, room and board to measured scans, with credible intervals.

`values` holds quantities, parameters and results, `likelihood` the probability of readings, and `search` the search for
its maximum and the samples of the posterior. `fitting` runs a whole fit. `plain_fit` is the search of `compare --fit`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
