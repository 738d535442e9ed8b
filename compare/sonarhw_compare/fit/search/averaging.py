"""Average of the posterior over the standard deviations of tolerated values, from the curvature at the maximum.

The maximum and its covariance are those with the widest priors. With a narrower prior, a normal posterior remains
normal, and its mean, covariance and evidence have a closed form. The average is a mixture of normal distributions.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.random import RandomState
from scipy.special import logsumexp

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.tolerance_prior import LEVELS, PROBABILITIES, TolerancePrior


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
