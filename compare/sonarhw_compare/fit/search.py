"""Search for the maximum of the likelihood, its curvature, and samples of the posterior."""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.random import RandomState
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import logsumexp
from sonarhw_sim.compiled import in_parts
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.predict.settled import predict_readings

from sonarhw.readings import BoolArray, FloatArray
from sonarhw_compare.fit.likelihood import ReadingNoise
from sonarhw_compare.fit.objective import COARSE, LEVELS, MODERATE, PROBABILITIES, Objective, Problem, TolerancePrior
from sonarhw_compare.fit.parameters import Parameter, tolerated_parameters
from sonarhw_compare.fit.result import FitOptions

# Maximization of the likelihood from a starting point, and the curvature at the maximum.
#
# The likelihood has steps wherever an echo crosses the detection threshold. It is therefore maximized three times,
# with less noise each time: `objective.COARSE`, then `MODERATE`, then the fitted noise. Paths are searched again
# wherever the sensor has moved.


_SEARCHES = 6  # of paths, in one stage
_ITERATIONS = 8
_GAIN = 1.0  # of the log-likelihood of whole readings; a refinement that gains less is the last
_SETTLED = 0.5  # steps; a smaller change needs no new search of paths
_ENOUGH = 1e-4  # tolerance of the log-likelihood
_NARROW = 0.05  # tolerance of a parameter, in widths
_WORST = -1e12  # replaces -inf
_FLATTEST = 0.01  # smallest curvature over a width; a normal distribution has 1
_HIDDEN = 0.2  # of a direction; a normal distribution is lower by 0.5 at 1
_WIDEST = 30.0  # steps, largest width, for a flat likelihood
# Shares of the range between the bounds at which a value is tried; irregular, because rooms are symmetric
_TRIED = np.append(np.arange(1, 9) * ((math.sqrt(5) - 1) / 2) % 1, (0.0, 1.0))
_ROUNDING = 1e-9  # of the log-likelihood; the sum over a scan is rounded to about 1e-12


@dataclass(frozen=True)
class Peak:
    """A maximum of the likelihood."""

    score: float  # log-likelihood and prior, natural logarithm
    values: FloatArray  # (size,) of the problem
    objective: Objective  # with the paths there


def peak_at(problem: Problem, values: FloatArray, prediction: PredictionOptions | None = None) -> Peak:
    """Return the maximum at `values` (size,)."""
    objective = problem.near(values, prediction)
    return Peak(objective(values), values, objective)


def highest(problem: Problem, values: FloatArray, most: int, tick: Callable[[], None] = lambda: None) -> Peak:
    """Return the highest maximum of one complete refinement from `values` and up to `most` further ones."""

    def refine(values: FloatArray) -> Peak:
        return peak_at(problem, refined(problem, values, None, (None,), tick=tick))

    return max(repeated(refine(values), refine, most, _GAIN * problem.mean_share), key=lambda peak: peak.score)


def repeated(first: Peak, refine: Callable[[FloatArray], Peak], most: int, least: float = _GAIN) -> list[Peak]:
    """Return `first` and up to `most` maxima, each refined from the one before, until one gains less than `least`.

    With little noise, one refinement may end at a step of the likelihood.
    """
    peaks = [first]
    for _ in range(most):
        peaks.append(refine(peaks[-1].values))
        if peaks[-1].score - peaks[-2].score < least:
            break
    return peaks


def refined(
    problem: Problem,
    values: FloatArray,
    prediction: PredictionOptions | None = None,
    stages: tuple[ReadingNoise | None, ...] = (COARSE, MODERATE, None),
    free: BoolArray | None = None,
    tick: Callable[[], None] = lambda: None,
    searches: int = _SEARCHES,
    iterations: int = _ITERATIONS,
) -> FloatArray:
    """Return the values (size,) at the maximum near `values`, after one stage for each noise in `stages`.

    None as a stage also fits the noise. With `free` (parameters,), only those parameters change. `tick` is called
    before each search of paths.
    """
    parameters = len(problem.parameters)
    rows = [row for row, parameter in enumerate(problem.parameters) if parameter.quantity.moves_paths]
    for noise in stages:
        movable = np.append(
            np.ones(parameters, np.bool_) if free is None else free, np.full(len(problem.noises), noise is None)
        )
        values = values if noise is None else problem.with_noise(values, noise)
        for _ in range(searches):
            tick()
            before, values = values, climb(problem.near(values, prediction), values, movable, iterations)
            if not (np.abs(values - before)[rows] > _SETTLED * problem.steps[rows]).any():
                break
    return values


def climb(objective: Objective, values: FloatArray, movable: BoolArray, iterations: int = _ITERATIONS) -> FloatArray:
    """Return the values at the maximum of an objective near `values`; only those `movable` (size,) change.

    Powell's method needs no derivatives, and its line searches pass over small steps of the likelihood. Values without
    effect do not change: a line search over equal numbers would follow their rounding.
    """
    rows = np.flatnonzero(movable & ~without_effect(objective, values))
    if not len(rows):
        return values
    lower, upper = objective.problem.bounds
    directions = directions_of(objective, values, rows)

    def at(along: FloatArray) -> FloatArray:
        return np.asarray(np.clip(values + along @ directions, lower, upper))

    def loss(scaled: FloatArray) -> float:
        return -max(objective(at(scaled)), _WORST)

    maximum = minimize(
        loss,
        np.zeros(len(rows)),
        method="Powell",
        options={"maxiter": iterations, "ftol": _ENOUGH, "xtol": _NARROW},
    )
    return at(np.asarray(maximum.x)) if maximum.fun < loss(np.zeros(len(rows))) else values


def without_effect(objective: Objective, values: FloatArray, least: float = _ROUNDING) -> BoolArray:
    """Return which parameters without a normal prior have no effect on the objective, (size,).

    Each of them is tried alone within its bounds, and changes the log-likelihood by less than `least`.
    """
    idle, best = np.zeros(len(values), np.bool_), objective(values)
    for row, parameter in enumerate(objective.problem.parameters):
        if parameter.expected is None and math.isfinite(best):
            tried = np.tile(values, (len(_TRIED), 1))
            lower, upper = parameter.limits
            tried[:, row] = lower + _TRIED * (upper - lower)
            idle[row] = bool((np.abs(objective.many(tried) - best) < least).all())
    return idle


def widths_of(objective: Objective, top: FloatArray) -> FloatArray:
    """Return the change of each value alone that lowers the log-likelihood by 0.5, (size,)."""
    steps = objective.problem.steps
    return _multiples(objective, top, np.diag(steps)) * steps


def _multiples(objective: Objective, top: FloatArray, units: FloatArray) -> FloatArray:
    """Return how many times each of `units` (k, size) lowers the log-likelihood by 0.5, (k,)."""
    best, widths = objective(top), np.full(len(units), 0.05)
    wider = np.ones(len(units), np.bool_)
    while wider.any():
        lost = best - _both(objective, top, widths[wider, None] * units[wider])
        # sides out of bounds are ignored
        most = np.where(np.isfinite(lost), lost, -np.inf).max(axis=0)
        wider[wider] = np.isfinite(lost).any(axis=0) & (most < 0.5)
        widths[wider] *= 1.5
        wider &= widths < _WIDEST
    return widths


def _both(objective: Objective, values: FloatArray, steps: FloatArray) -> FloatArray:
    """Return the log-likelihood at `values` (size,) plus and minus each of `steps` (k, size), (2, k)."""
    return objective.many(np.concatenate((values + steps, values - steps))).reshape(2, -1)


def covariance_of(objective: Objective, top: FloatArray) -> FloatArray:
    """Return the covariance (size, size) from the curvature at the maximum.

    It is measured twice: the second time along the principal directions, because the curvature along a ridge is lost in
    the roughness of the likelihood across it. Roughness can also hide a curvature altogether, so a direction is
    shortened if the log-likelihood is lower by 0.5 before a fifth of it.
    """
    directions = directions_of(objective, top)
    directions = _principal(objective, top, directions * _multiples(objective, top, directions)[:, None])
    widths = _multiples(objective, top, directions)
    directions *= np.where(widths < _HIDDEN, widths, 1.0)[:, None]
    return np.asarray(directions.T @ directions)


def directions_of(objective: Objective, values: FloatArray, rows: NDArray[np.intp] | None = None) -> FloatArray:
    """Return the principal directions of the posterior, (k, size), each one standard deviation long.

    Only the values in `rows` (k,) change; None: all. The curvature is measured over the distance at which the
    log-likelihood is lower by 0.5.
    """
    widths = np.diag(widths_of(objective, values))
    return _principal(objective, values, widths if rows is None else widths[rows])


def _principal(objective: Objective, values: FloatArray, units: FloatArray) -> FloatArray:
    """Return the principal directions (k, size) from the curvature over the distances `units` (k, size)."""
    first, second = np.tril_indices(len(units), -1)
    ends = _both(objective, values, np.concatenate((units, units[first] + units[second])))
    inside = np.isfinite(ends)
    # outside a bound there is one end only, or none
    counts = inside.sum(axis=0)
    means = np.where(inside, ends, 0.0).sum(axis=0) / np.maximum(counts, 1)
    bent = np.where(counts > 0, 2 * (means - objective(values)), -1.0)
    alone, together = np.split(bent, [len(units)])
    curvature = np.diag(alone)
    curvature[first, second] = curvature[second, first] = (together - alone[first] - alone[second]) / 2
    strengths, vectors = np.linalg.eigh(-curvature)
    return np.asarray((vectors / np.sqrt(np.maximum(strengths, _FLATTEST))).T @ units)


# Detection of parameters whose deviations are too small because the posterior has a long, narrow ridge.
#
# The sampler starts around the maximum and follows such a ridge too slowly to reach its end. As a test, one parameter
# is fixed several deviations from the maximum, within the bounds, and the others are optimized. A normal distribution
# loses half the square of that distance in log-likelihood; a long ridge loses almost nothing.


_TOGETHER = 1.9  # smallest eigenvalue of the correlations that is tested; 1 without correlation
_FAR = 6.0  # standard deviations from the maximum; nearer where a bound is nearer
_NEAREST = 3.5  # standard deviations; nothing is tested nearer, since a uniform distribution is 3.46 of them wide
_LITTLE = 0.25  # of the log-likelihood that a normal distribution loses at the same distance
_TAKES_PART = 0.5  # of the largest component of an eigenvector
_CLIMBS = 2


def underestimated(problem: Problem, top: FloatArray, covariance: FloatArray) -> tuple[Parameter, ...]:
    """Return the parameters that can change together by more than the covariance allows.

    Its first rows and columns are those of the parameters.
    """
    count = len(problem.parameters)
    deviations = np.sqrt(np.diag(covariance)[:count])
    if not (deviations > 0).all():
        return ()
    values, vectors = np.linalg.eigh(covariance[:count, :count] / np.outer(deviations, deviations))
    best = problem.near(top)(top)
    rows: set[int] = set()
    for value, vector in zip(values, vectors.T, strict=True):
        if value < _TOGETHER:
            continue
        takes_part = np.abs(vector) > _TAKES_PART * np.abs(vector).max()
        for direction in (vector, -vector):
            change = np.where(takes_part, deviations * direction / np.abs(vector).max(), 0.0)
            far = _distance(problem, top[:count], change)
            if far >= _NEAREST:
                lost = best - _with_one_fixed(problem, top, far * change, int(np.abs(vector).argmax()))
                if lost < _LITTLE * far**2 / 2:
                    rows.update(np.flatnonzero(takes_part).tolist())
    return tuple(problem.parameters[row] for row in sorted(rows))


def _distance(problem: Problem, top: FloatArray, change: FloatArray) -> float:
    """Return how many times `change` (count,) can be added within the bounds, at most 6."""
    lower, upper = (bound[: len(top)] for bound in problem.bounds)
    room = np.where(change > 0, upper - top, top - lower)
    moved = change != 0
    return min(_FAR, float((room[moved] / np.abs(change[moved])).min()))


def _with_one_fixed(problem: Problem, top: FloatArray, change: FloatArray, row: int) -> float:
    """Return the maximum near `top` plus `change`, with the parameter `row` fixed there."""
    moved = top.copy()
    moved[: len(change)] += change
    moved = np.clip(moved, *problem.bounds)  # at a bound, rounding could put it outside
    movable = np.ones(len(top), np.bool_)
    movable[row] = False
    movable[len(problem.parameters) :] = False
    for _ in range(_CLIMBS):
        moved = climb(problem.near(moved), moved, movable)
    return problem.near(moved)(moved)


# Average of the posterior over the standard deviations of tolerated values, from the curvature at the maximum.
#
# The maximum and its covariance are those with the widest priors. With a narrower prior, a normal posterior remains
# normal, and its mean, covariance and evidence have a closed form. The average is a mixture of normal distributions.


@dataclass(frozen=True)
class Mixture:
    """A mixture of m normal distributions of vectors."""

    weights: FloatArray  # (m,)
    means: FloatArray  # (m, size)
    covariances: FloatArray  # (m, size, size)

    @property
    def mean(self) -> FloatArray:
        """Its mean, (size,)."""
        return np.asarray(self.weights @ self.means)

    @property
    def covariance(self) -> FloatArray:
        """Its covariance, (size, size)."""
        away = self.means - self.mean
        return np.asarray(np.einsum("m,mij->ij", self.weights, self.covariances + away[:, :, None] * away[:, None, :]))

    def draws(self, count: int, random: RandomState, wider: float = 1.0) -> FloatArray:
        """Return independent draws, (count, size), of the mixture with standard deviations `wider` times as large."""
        chosen = random.choice(len(self.weights), count, p=self.weights)
        values, vectors = np.linalg.eigh(self.covariances[chosen])
        normal = random.standard_normal((count, values.shape[1])) * np.sqrt(np.maximum(values, 0.0))
        return np.asarray(self.means[chosen] + wider * np.einsum("mij,mj->mi", vectors, normal))


def averaged(top: FloatArray, covariance: FloatArray, prior: TolerancePrior) -> Mixture:
    """Return the posterior averaged over all combinations of standard deviations of the groups of tolerated values.

    `top` (size,) and `covariance` (size, size) are those of the posterior with the widest priors.
    """
    levels = np.array(list(product(LEVELS, repeat=len(prior.groups))))
    expected = np.log(np.array(list(product(PROBABILITIES, repeat=len(prior.groups))))).sum(axis=1)
    by_value = levels @ prior.groups  # (m, t)
    rows, scale = prior.rows, np.sqrt(np.diag(covariance))
    unit = covariance / np.outer(scale, scale)  # well conditioned
    added = (by_value**-2 - 1) * (scale[rows] / prior.widest) ** 2  # precision beyond that of the widest prior
    among = unit[np.ix_(rows, rows)]
    # 1 + C A, for the values of the prior alone
    grown = np.eye(len(rows)) + among * added[:, None, :]
    away = (top[rows] - prior.middle) / scale[rows]
    pulled = added[:, :, None] * np.linalg.solve(grown, np.broadcast_to(among, grown.shape))
    gains = added[:, :, None] * np.eye(len(rows)) - pulled * added[:, None, :]  # A - A C' A
    means = top - scale * ((gains @ away) @ unit[rows])
    covariances = unit - np.einsum("ti,mtu,uj->mij", unit[rows], gains, unit[rows], optimize=True)
    evidence = (
        expected - 0.5 * np.linalg.slogdet(grown)[1] - 0.5 * ((gains @ away) @ away) - np.log(by_value).sum(axis=1)
    )
    return Mixture(np.exp(evidence - logsumexp(evidence)), means, covariances * np.outer(scale, scale))


# Samples of the posterior, for standard deviations, credible intervals and correlations.
#
# The curvature at the maximum is not enough, because the likelihood has a step wherever an echo appears or
# disappears. The sampler is emcee's ensemble (Foreman-Mackey et al. 2013) with differential evolution moves (ter
# Braak 2006). Its autocorrelation time here is about 25 steps, a third of that of Goodman and Weare's stretch move.


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


# Posterior of a fit near its best solution, with all that is not exact as further parameters: median, interval,
# draws.
#
# The further parameters are walls, levels and the turntable's scale (`values/tolerances.py`). They are maximised
# together with the solution, and then sampled with it. `fitting` reports the marginal distributions of the free
# parameters.


MOST_WALLS = 12  # that may be off: those that most echoes touch
# coordinates that are swept together before a refinement, and the steps of each, in its own unit
_SWEEPS = (
    ("aperture", "threshold", "heading"),
    ("reflectance", "threshold"),
    ("scale", "heading"),
    ("aperture", "threshold", "heading"),
)
_STEPS = {
    "aperture": (-4e-3, -2e-3, 0.0, 2e-3, 4e-3),
    # without the right aperture and reflectances, the threshold before is wrong by up to 9 dB
    "threshold": tuple(1.5 * step for step in range(-6, 7)),
    "reflectance": (-0.3, -0.2, -0.1, 0.0, 0.05),
    "heading": tuple(math.radians(turn) for turn in (-4.0, -3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0)),
    "scale": (-0.02, -0.01, -0.005, 0.0, 0.005, 0.01, 0.02),
}
_MARGINAL_SEARCHES, _MARGINAL_ITERATIONS = 2, 4  # of a refinement of all values
_MARGINAL_CLIMBS = 4  # most further refinements
_SAYS_NOTHING = 0.01  # of the log-likelihood, less than that of any value of a parameter
_NORMAL_INTERVAL = 1.96  # standard deviations, half the 95 % interval of a normal distribution


@dataclass(frozen=True)
class Marginals:
    """The posterior of the vector of `problem`: free parameters, tolerated values, noise."""

    problem: Problem
    tolerated: tuple[Parameter, ...]
    middle: FloatArray  # (size,), medians
    lower: FloatArray  # (size,), of the 95 % credible intervals
    upper: FloatArray
    covariance: FloatArray  # (size, size)
    narrow: FloatArray  # the same without the factors `Problem.widenings`
    samples: FloatArray  # (m, size)

    @property
    def shifts(self) -> tuple[FloatArray, FloatArray]:
        """Differences of the tolerated values from those of room and board, (t,), and their covariance (t, t)."""
        rows = np.flatnonzero([parameter.is_tolerated for parameter in self.problem.parameters])
        mean = self.samples.mean(axis=0) if len(self.samples) else self.middle
        return mean[rows] - [parameter.expected or 0.0 for parameter in self.tolerated], self.covariance[
            np.ix_(rows, rows)
        ]


def marginals_of(problem: Problem, values: FloatArray, options: FitOptions, tick: Callable[[float], None]) -> Marginals:
    """Return the posterior near the best `values` (size,) of a problem without tolerated values.

    A parameter that the scans say nothing about has the distribution of its prior, around its value before the fit.
    """
    tolerated = tolerated_at(problem, values, options)
    whole = problem.with_tolerated(tolerated)
    top = problem.with_values_of(tolerated, values)
    if tolerated:
        top = _maximum(whole, _swept(whole, top))
    idle = without_effect(whole.near(top), top, _SAYS_NOTHING)
    determined = _of_known(whole.without(idle), tolerated, top[~idle], options, tick)
    return _with_priors(determined, whole, idle, options) if idle.any() else determined


def _of_known(
    whole: Problem,
    tolerated: tuple[Parameter, ...],
    top: FloatArray,
    options: FitOptions,
    tick: Callable[[float], None],
) -> Marginals:
    """Return the posterior near its maximum `top` (size,)."""
    start = averaged(top, covariance_of(whole.near(top), top), whole.tolerance_prior)
    if options.samples:
        objective = replace(whole, averages=True).near(top)
        samples = samples_of(objective, start, options.samples, options.seed, tick)
        middle, narrow = np.median(samples, axis=0), np.cov(samples, rowvar=False)
        samples = np.clip(middle + whole.widenings * (samples - middle), *whole.bounds)
        lower, upper = np.percentile(samples, CREDIBLE_INTERVAL, axis=0)
    else:
        samples, narrow = np.empty((0, whole.size)), start.covariance
        reach = _NORMAL_INTERVAL * whole.widenings * np.sqrt(np.diag(narrow))
        middle, lower, upper = np.clip((start.mean, start.mean - reach, start.mean + reach), *whole.bounds)
    covariance = narrow * np.outer(whole.widenings, whole.widenings)
    return Marginals(whole, tolerated, middle, lower, upper, covariance, narrow, samples)


def _with_priors(determined: Marginals, whole: Problem, idle: BoolArray, options: FitOptions) -> Marginals:
    """Return the posterior of `whole` from that without its parameters in `idle` (size,), whose priors are uniform."""
    rows = np.flatnonzero(idle)
    limits = np.array([whole.parameters[row].limits for row in rows]).T
    draws = np.random.RandomState(options.seed).uniform(limits[0], limits[1], (len(determined.samples), len(rows)))

    def joined(of_known: FloatArray, of_idle: FloatArray) -> FloatArray:
        both = np.empty((*of_known.shape[:-1], whole.size))
        both[..., ~idle], both[..., idle] = of_known, of_idle
        return both

    def spread(covariance: FloatArray) -> FloatArray:
        both = np.diag(joined(np.zeros(len(covariance)), (limits[1] - limits[0]) ** 2 / 12))
        both[np.ix_(~idle, ~idle)] = covariance
        return both

    lower, upper = (limits[0] + (limits[1] - limits[0]) * percent / 100 for percent in CREDIBLE_INTERVAL)
    return Marginals(
        whole,
        determined.tolerated,
        joined(determined.middle, whole.start()[idle]),
        joined(determined.lower, lower),
        joined(determined.upper, upper),
        spread(determined.covariance),
        spread(determined.narrow),
        joined(determined.samples, draws),
    )


def _swept(problem: Problem, values: FloatArray) -> FloatArray:
    """Return the best of several combinations of heading and tolerated values of the board, with moderate noise.

    A wrong beam width or turntable shifts the heading by several readings, and a maximisation would not find back.
    """
    objective = problem.near(values)
    idle = without_effect(objective, values)
    best = problem.with_noise(values, MODERATE)
    for words in _SWEEPS:
        grids = [(rows, _STEPS[word]) for word in words if (rows := _rows_named(problem, word, idle))]
        combinations = list(product(*(steps for _, steps in grids)))
        candidates = np.tile(best, (1 + len(combinations), 1))
        for (rows, _), shifts in zip(grids, zip(*combinations, strict=True), strict=True):
            candidates[1:, rows] += np.array(shifts)[:, None]
        best = candidates[objective.many(candidates).argmax()]
    return best


def _maximum(problem: Problem, values: FloatArray) -> FloatArray:
    """Return the maximum near `values` after repeated refinement, of few iterations each."""

    def refine(values: FloatArray) -> Peak:
        return peak_at(problem, refined(problem, values, None, (None,), searches=1, iterations=_MARGINAL_ITERATIONS))

    top = refined(problem, values, None, (MODERATE, None), searches=_MARGINAL_SEARCHES, iterations=_MARGINAL_ITERATIONS)
    return repeated(peak_at(problem, top), refine, _MARGINAL_CLIMBS)[-1].values


def _rows_named(problem: Problem, name: str, idle: BoolArray) -> list[int]:
    """Return the rows of a quantity, without those in `idle` (size,)."""
    return [
        row for row, parameter in enumerate(problem.parameters) if parameter.quantity.name == name and not idle[row]
    ]


def tolerated_at(problem: Problem, values: FloatArray, options: FitOptions) -> tuple[Parameter, ...]:
    """Return the parameters that are neither free nor exact; of many walls, those that the echoes touch most."""
    if options.exact:
        return ()
    walls = problem.room.names[: len(problem.room.walls)]
    if len(walls) > MOST_WALLS:
        walls = _walls_touched(problem, values)
    return tolerated_parameters(problem.parameters, problem.room, problem.board, options.room_tolerance, walls)


def _walls_touched(problem: Problem, values: FloatArray) -> tuple[str, ...]:
    """Return the names of up to 12 walls that the predicted echoes touch, most touched first."""
    room, places, board = problem.setting(values)
    touched: Counter[int] = Counter()
    for scan, place in zip(problem.scans, places, strict=True):
        here = board.faced(place)
        headings = board.heading_at(scan.angles, here.heading)
        predicted = predict_readings(room, here, board, headings, problem.prediction).near
        surfaces = predicted.paths.surfaces[predicted.winners[predicted.winners >= 0]]
        touched.update(surfaces[(surfaces >= 0) & (surfaces < len(room.walls))].tolist())
    return tuple(room.names[wall] for wall, _ in touched.most_common(MOST_WALLS))
