"""How sure a fit is: samples of the posterior, from which come standard deviations, regions and correlations.

Takes an `Objective` at its top; hands on samples. They are drawn by emcee's ensemble (Foreman-Mackey et al. 2013) that
moves by differences of its own members (ter Braak 2006): where an echo comes or goes the likelihood has steps, and its
curvature at the top says too little. Members forget where they were within some 25 steps, a third of what Goodman and
Weare's stretches need here.
"""

import math
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np
from numpy.random import RandomState

from sonarhw.readings import FloatArray
from sonarhw_compare.cores import core_count
from sonarhw_compare.fit.likelihood.objective import Objective
from sonarhw_compare.fit.search.refine import directions_of

_WALKERS = 48  # at least: with fewer, differences span too little
_WIDER = 1.2  # than the curvature at the top says: a narrow ensemble widens more slowly than a wide one narrows
_FORGOTTEN = 80  # steps after which members no longer know where they began
_LONGER = 1  # times at most that twice as many are drawn anew, where they have not settled
_TELLING = 50  # steps: fewer do not tell whether they have settled
_DRIFT = 0.4  # standard deviations from the mean of one half to that of the other, of draws that have settled
_GROWTH = 1.5  # of the deviation, from one half to the other
REGION = (2.5, 97.5)  # percent


def samples_of(
    objective: Objective, top: FloatArray, count: int, seed: int, tick: Callable[[float], None] = lambda _: None
) -> FloatArray:
    """About `count` draws (m, size) from the posterior, the ensemble begun round `top` (size,).

    Half as many are thrown away before; where it has not settled then, twice as many are drawn anew.
    `tick` is called with the share that is done.
    """
    import emcee  # here, for it takes half a second to load: the window offers a fit, few starts of it make one

    random = RandomState(seed)
    walkers = max(_WALKERS, 2 * (len(top) + 2))
    begin = _ensemble(objective, top, walkers, random)
    state = emcee.State(begin, random_state=random.get_state())
    steps = math.ceil(count / walkers)
    most = _LONGER if steps >= _TELLING else 0
    # the first is thrown away in any case
    parts = [min(steps, max(steps // 2, _FORGOTTEN)), *(steps * 2**longer for longer in range(most + 1))]
    with _at_once(objective, core_count()) as several:
        # not its snooker move: what that draws in emcee 3.1.6 is 6 % too narrow or more
        sampler = emcee.EnsembleSampler(walkers, len(top), several, moves=emcee.moves.DEMove(), vectorize=True)
        for part, iterations in enumerate(parts):
            sampler.reset()
            for done, _ in enumerate(sampler.sample(state, iterations=iterations)):
                tick((part + done / iterations) / len(parts))
            state = sampler.get_last_sample()
            if part and _settled(sampler.get_chain()):
                break
    return np.asarray(sampler.get_chain(flat=True))


@contextmanager
def _at_once(objective: Objective, threads: int) -> Iterator[Callable[[FloatArray], FloatArray]]:
    """The objective of many values (m, size) at once, (m,): kernels do not hold Python's lock."""

    def share(values: FloatArray) -> list[float]:
        return [objective(one) for one in values]

    with ThreadPoolExecutor(threads) as pool:
        yield lambda values: np.concatenate(list(pool.map(share, np.array_split(values, threads))))


def _settled(chain: FloatArray) -> bool:
    """Whether both halves of a chain (steps, walkers, size) are about the same distribution."""
    halves = [half.reshape(-1, chain.shape[2]) for half in np.array_split(chain, 2)]
    (early, late), (narrow, wide) = ([of(half, axis=0) for half in halves] for of in (np.mean, np.std))
    drift = np.abs(late - early) / np.maximum(np.maximum(narrow, wide), 1e-300)
    growth = np.maximum(wide, 1e-300) / np.maximum(narrow, 1e-300)
    return bool((drift < _DRIFT).all() and (growth < _GROWTH).all())


def _ensemble(objective: Objective, top: FloatArray, walkers: int, random: RandomState) -> FloatArray:
    """Where the ensemble begins, (walkers, size): about as wide as the posterior in each direction."""
    lower, upper = objective.problem.bounds
    spread = directions_of(objective, top)
    begin = top + _WIDER * random.standard_normal((walkers, len(top))) @ spread
    # walkers on one bound would span nothing
    inside = np.minimum(np.hypot.reduce(spread, axis=0), upper - lower) * random.uniform(1e-4, 1e-2, begin.shape)
    return np.asarray(np.clip(begin, lower + inside, upper - inside))
