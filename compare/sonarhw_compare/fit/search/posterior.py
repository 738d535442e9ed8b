"""Samples of the posterior, for standard deviations, credible intervals and correlations.

The curvature at the maximum is not enough, because the likelihood has a step wherever an echo appears or disappears.
The sampler is emcee's ensemble (Foreman-Mackey et al. 2013) with differential evolution moves (ter Braak 2006). Its
autocorrelation time here is about 25 steps, a third of that of Goodman and Weare's stretch move.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.random import RandomState
from sonarhw_sim.compiled import in_parts

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.objective import Objective
from sonarhw_compare.fit.search.averaging import Mixture

_WALKERS = 96  # at least; with 48, draws of 20 values are correlated for twice as many evaluations
_WIDER = 1.5  # initial width by that of the curvature; a wide ensemble converges faster than a narrow one
_SHORTEST = 0.01  # of the distance of a draw from the mean
# Burn-in, steps for each value: from the curvature at one of many narrow maxima, fits with 26 values need 250. With few
# samples, at most so many times their steps. The first half is that of a smooth likelihood.
_BURN_IN, _MOST_BURN_IN = 10, 6
# Scales of the moves relative to the best one for a normal distribution, and how often each is used. Smaller moves are
# accepted more often where the likelihood has steps.
_MOVES = ((1.0, 0.6), (0.5, 0.4))
_LONGER = 1  # most repetitions with twice as many samples, if the chain has not converged
_TESTABLE = 50  # steps; fewer are too few to test for convergence
_DRIFT = 0.4  # standard deviations, largest difference between the means of both halves of a converged chain
_GROWTH = 1.5  # largest ratio of the deviations of both halves
_LEAST_PART = 4  # vectors, computed in about 1 ms; a thread starts in a tenth of that
CREDIBLE_INTERVAL = (2.5, 97.5)  # percentiles


def samples_of(
    objective: Objective, start: Mixture, count: int, seed: int, tick: Callable[[float], None] = lambda _: None
) -> FloatArray:
    """Return about `count` samples (m, size) of the posterior; the ensemble starts with draws from `start`.

    A burn-in is discarded first; its first half is that of the smooth objective. If the chain has not converged, twice
    as many are drawn again. `tick` receives the completed share, 0..1.
    """
    import emcee  # loads in half a second, and most runs of the window need no fit

    random = RandomState(seed)
    size = start.means.shape[1]
    walkers = max(_WALKERS, 2 * (size + 2))
    begin = _ensemble(objective, start, walkers, random)
    state = emcee.State(begin, random_state=random.get_state())
    steps = math.ceil(count / walkers)
    most = _LONGER if steps >= _TESTABLE else 0
    discarded = min(_MOST_BURN_IN * steps, max(steps // 2, _BURN_IN * size))
    # the first two parts are always discarded
    parts = [discarded // 2, discarded - discarded // 2, *(steps * 2**longer for longer in range(most + 1))]
    # no snooker move: its samples in emcee 3.1.6 are at least 6 % too narrow
    best = 2.38 / math.sqrt(2 * size)
    moves = [(emcee.moves.DEMove(gamma0=scale * best), weight) for scale, weight in _MOVES]
    for part, iterations in enumerate(parts):
        of_many = _in_parts(objective.smooth if part == 0 else objective.many)
        sampler = emcee.EnsembleSampler(walkers, size, of_many, moves=moves, vectorize=True)
        sampler.log_prob_fn = of_many  # its wrapper prints every exception, also that of Ctrl-C, to standard output
        for done, _ in enumerate(sampler.sample(state, iterations=iterations)):
            tick((part + done / iterations) / len(parts))
        # probabilities of one objective are not those of the next
        state = emcee.State(sampler.get_last_sample().coords, random_state=sampler.random_state)
        # the noise has no interval; a kind that the scan hardly has drifts for long, and nothing depends on it
        if 1 < part <= most + 1 and _settled(sampler.get_chain()[:, :, : len(objective.problem.parameters)]):
            break
    return np.asarray(sampler.get_chain(flat=True))


def _in_parts(of_many: Callable[[FloatArray], FloatArray]) -> Callable[[FloatArray], FloatArray]:
    """Return a function of vectors (m, size) that is computed in threads."""
    return lambda values: np.concatenate(
        in_parts(lambda begin, end: of_many(values[begin:end]), len(values), _LEAST_PART)
    )


def _settled(chain: FloatArray) -> bool:
    """Report whether both halves of a chain (steps, walkers, size) have about the same distribution."""
    halves = [half.reshape(-1, chain.shape[2]) for half in np.array_split(chain, 2)]
    (early, late), (narrow, wide) = ([of(half, axis=0) for half in halves] for of in (np.mean, np.std))
    drift = np.abs(late - early) / np.maximum(np.maximum(narrow, wide), 1e-300)
    growth = np.maximum(wide, 1e-300) / np.maximum(narrow, 1e-300)
    return bool((drift < _DRIFT).all() and (growth < _GROWTH).all())


def _ensemble(objective: Objective, start: Mixture, walkers: int, random: RandomState) -> FloatArray:
    """Return the initial ensemble, (walkers, size), a little wider than `start`."""
    lower, upper = objective.problem.bounds
    begin = start.draws(walkers, random, _WIDER)
    # back along the line from the mean, so that parameters that change together still do at a bound
    rows = slice(len(objective.problem.parameters))
    mean = np.clip(start.mean, lower, upper)[rows]
    away = begin[:, rows] - mean
    reach = np.where(away > 0, upper[rows] - mean, mean - lower[rows]) / np.maximum(np.abs(away), 1e-300)
    shorter = np.minimum(1.0, reach.min(axis=1, initial=1.0))
    # with a mean on a bound, these would all be at the mean; each value is clipped instead
    shorter[shorter < _SHORTEST] = 1.0
    begin[:, rows] = mean + away * shorter[:, None]
    # walkers on a bound would all have the same value
    spread = np.sqrt(np.diag(start.covariance))
    inside = np.minimum(spread, upper - lower) * random.uniform(1e-4, 1e-2, begin.shape)
    return np.asarray(np.clip(begin, lower + inside, upper - inside))
