"""How sure a fit is: samples of the posterior, from which come standard deviations, regions and correlations.

Takes an `Objective` at its top; hands on samples. They are drawn by emcee's ensemble (Foreman-Mackey et al. 2013) that
moves by differences of its own members (ter Braak 2006; ter Braak and Vrugt 2008): where an echo comes or goes the
likelihood has steps, and its curvature at the top says too little. Members forget where they were within some 25 steps,
a third of what Goodman and Weare's stretches need here.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.random import RandomState

from compare.fit.objective import Objective
from compare.fit.refine import directions_of
from sonarhw.readings import FloatArray

_BURN = 0.5  # of the samples more, thrown away at the beginning
_WALKERS = 48  # at least: with fewer, differences span too little
REGION = (2.5, 97.5)  # percent


def samples_of(
    objective: Objective, top: FloatArray, count: int, seed: int, tick: Callable[[float], None] = lambda _: None
) -> FloatArray:
    """About `count` draws (m, size) from the posterior, the ensemble begun round `top` (size,).

    `tick` is called with the share that is done.
    """
    import emcee  # here, for it takes half a second to load: the window offers a fit, few starts of it make one

    random = RandomState(seed)
    walkers = max(_WALKERS, 2 * (len(top) + 2))
    begin = _ensemble(objective, top, walkers, random)
    moves = [(emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2)]
    sampler = emcee.EnsembleSampler(walkers, len(top), objective, moves=moves)
    state = emcee.State(begin, random_state=random.get_state())
    burn, steps = math.ceil(_BURN * count / walkers), math.ceil(count / walkers)
    for done, _ in enumerate(sampler.sample(state, iterations=burn + steps)):
        tick(done / (burn + steps))
    return np.asarray(sampler.get_chain(discard=burn, flat=True))


def _ensemble(objective: Objective, top: FloatArray, walkers: int, random: RandomState) -> FloatArray:
    """Where the ensemble begins, (walkers, size): about as wide as the posterior in each direction."""
    lower, upper = objective.problem.bounds
    spread = directions_of(objective, top)
    begin = top + 0.7 * random.standard_normal((walkers, len(top))) @ spread
    # walkers on one bound would span nothing
    inside = np.minimum(np.hypot.reduce(spread, axis=0), upper - lower) * random.uniform(1e-4, 1e-2, begin.shape)
    return np.asarray(np.clip(begin, lower + inside, upper - inside))
