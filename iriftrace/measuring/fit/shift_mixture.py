"""Mixtures of several members' predictions that are closest to the measured values."""

from __future__ import annotations

import numpy as np
from scipy.linalg import null_space, qr
from scipy.optimize import nnls
from scipy.special import chdtri

from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.measuring.camera_motion import OUTLIER

NEAREST = 4
"""Number of members, nearest to the fit in shifts of the dots, that represent the residual."""

MOST_OUTLIERS = 0.02
"""Fraction of dots far from the fit above which they are not outliers but other air."""

BEYOND_NOISE = 4.0
"""Multiple of a component's noise; 0.03 % of the dots without other errors exceed it."""

_SUM = 1e4  # Weight of the row that makes the weights sum to 1, relative to that of the shifts.
_NONE = 1e-6  # Smaller weights are 0.


class ShiftMixture:
    """Least squares of (k, n, c) predicted against (n, c) measured values, without outliers.

    Values are shifts, px, of two components, or temperatures, K, of one. `free` (n, 2, 6 v)
    are derivatives of the shifts by the motions of v cameras, or None.

    Attributes
    ----------
    weights : (k,) array
        Not negative; their sum is 1.
    used : (n,) array of bool
        Shifts that are not outliers.
    residual : float
        Root mean square of a component of the residual, by its degrees of freedom.
    """

    def __init__(
        self, predicted: FloatArray, measured: FloatArray, free: FloatArray | None = None
    ) -> None:
        self._predicted, self._measured = predicted, measured
        # Rotations in units that compare with the translations.
        self._units = None if free is None else 1.0 / np.sqrt(np.mean(free**2, axis=(0, 1)))
        self._free = None if free is None or self._units is None else free * self._units
        self.used: BoolArray = np.ones(len(measured), dtype=np.bool_)
        for _ in range(20):
            self._columns, self._target = self._without_motion(self.used)
            self.weights = simplex_weights(self._columns, self._target)
            lengths = np.linalg.norm(self.left(self.weights, everywhere=True), axis=1)
            # Median length of a vector of c normal components of deviation 1.
            median = np.sqrt(chdtri(measured.shape[1], 0.5))
            spread = float(np.median(lengths[self.used]) / median)
            inside = lengths <= max(OUTLIER * spread, 1e-9)
            if np.mean(~inside) > MOST_OUTLIERS:
                inside = np.ones_like(inside)
            if np.array_equal(inside, self.used):
                break
            self.used = inside
        freedom = (
            self._target.size
            - (self.weights > 0).sum()
            + 1
            - (0 if free is None else free.shape[2])
        )
        rest = self._columns @ self.weights - self._target
        self._freedom = max(int(freedom), 1)
        self.residual = float(np.sqrt((rest**2).sum() / self._freedom))

    @property
    def motion(self) -> FloatArray | None:
        """(6 v,) motions of v cameras, mm and rad; None if they were not fitted."""
        if self._free is None or self._units is None:
            return None
        return np.asarray(self._units * self._motion_of(self.weights))

    def left(self, weights: FloatArray, everywhere: bool = False) -> FloatArray:
        """(n, c) array: measured minus predicted values, with the best motion, used dots."""
        rows = np.ones_like(self.used) if everywhere else self.used
        rest = self._measured - np.tensordot(weights, self._predicted, axes=1)
        if self._free is not None:
            rest = rest - self._free @ self._motion_of(weights)
        return np.asarray(rest[rows])

    def foreign(self, noise: float) -> float:
        """Fraction of the used values whose residual exceeds all predictions and the noise.

        Air of another kind, such as the plume of another body, moves dots that no member moves as
        far; a coarse mesh changes the shifts of those that are moved.
        """
        left = np.linalg.norm(self.left(self.weights), axis=1)
        most = np.linalg.norm(self._predicted[:, self.used], axis=2).max(axis=0)
        return float(np.mean(left > np.maximum(most, BEYOND_NOISE * noise)))

    def scaled(self) -> tuple[float, float]:
        """Factor of the mixture that is closest to the measured values, and the residual with it.

        Air of another contrast, such as that of a hotter wall, has a factor other than 1.
        """
        mixed = self._columns @ self.weights
        size = float(mixed @ mixed)
        factor = float(mixed @ self._target) / size if size > 0.0 else 1.0
        rest = factor * mixed - self._target
        return factor, float(np.sqrt((rest**2).sum() / self._freedom))

    def covariance(self, noise: float) -> FloatArray:
        """(k, k) covariance of the weights, by the noise of a component and the residual.

        The residual counts as noise of the shifts, which scatters the weights: the covariance of
        the noise is multiplied by chi^2 / f, the square of the Birge ratio, if that exceeds 1
        (Birge, Phys. Rev. 40, 207, 1932). Its systematic part counts as a step towards each of the
        nearest members. This part is the excess of the squared residual over that of the noise,
        plus two of its standard deviations, sqrt(2 / f) of it each, which no residual shows. The
        relative uncertainty of all weights together, the contrast of the air, is that of the shift
        of a single dot: devices look through other air than most dots.
        """
        count = len(self.weights)
        found = np.zeros((count, count))
        support = np.flatnonzero(self.weights)
        if len(support) > 1:
            along = null_space(np.ones((1, len(support))))
            columns = self._columns[:, support] @ along
            # Weights lie between 0 and 1, even if the dots do not determine them.
            precision = columns.T @ columns / max(self.residual, noise) ** 2 + 4.0 * np.eye(
                along.shape[1]
            )
            found[np.ix_(support, support)] = along @ np.linalg.inv(precision) @ along.T
        steps = np.eye(count) - self.weights
        size = np.sqrt(np.mean((self._columns @ steps.T) ** 2, axis=0))
        near = np.argsort(size)
        near = near[size[near] > 1e-9 * size.max()][:NEAREST]
        systematic = self.systematic(noise)
        scaled = steps[near] * (systematic / size[near])[:, None]
        found += scaled.T @ scaled
        whole = max(float(np.sqrt(np.mean((self._columns @ self.weights) ** 2))), systematic)
        contrast = max(systematic / whole, self._off_by_dot(noise))
        return np.asarray(found + contrast**2 * np.outer(self.weights, self.weights))

    def systematic(self, noise: float) -> float:
        """Rms of a component of the residual beyond noise, with two deviations of its square."""
        hidden = 2.0 * noise**2 * np.sqrt(2.0 / self._freedom)
        return float(np.sqrt(max(self.residual**2 - noise**2, 0.0) + hidden))

    def _off_by_dot(self, noise: float) -> float:
        """Root mean square, over dots that moved, of the residual beyond noise over their shift."""
        mixed = np.tensordot(self.weights, self._predicted[:, self.used], axes=1)
        size = (mixed**2).sum(axis=1)
        moved = size > (BEYOND_NOISE * noise) ** 2
        beyond = (self.left(self.weights) ** 2).sum(axis=1) - mixed.shape[1] * noise**2
        fraction = (beyond[moved] / size[moved]).mean() if moved.any() else 0.0
        return float(np.sqrt(max(fraction, 0.0)))

    def _motion_of(self, weights: FloatArray) -> FloatArray:
        assert self._free is not None
        rest = self._measured - np.tensordot(weights, self._predicted, axes=1)
        rows = self._free[self.used].reshape(-1, self._free.shape[2])
        return np.asarray(np.linalg.lstsq(rows, rest[self.used].ravel(), rcond=1e-10)[0])

    def _without_motion(self, used: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Predicted (cm, k) and measured (cm,) values without what a motion can explain."""
        columns = self._predicted[:, used].reshape(len(self._predicted), -1).T
        target = self._measured[used].ravel()
        if self._free is None:
            return columns, target
        basis = qr(self._free[used].reshape(-1, self._free.shape[2]), mode="economic")[0]
        return columns - basis @ (basis.T @ columns), target - basis @ (basis.T @ target)


def simplex_weights(columns: FloatArray, target: FloatArray) -> FloatArray:
    """Weights (k,) >= 0 of the sum 1 with the least squares of ``columns @ weights - target``."""
    heavy = _SUM * max(float(np.linalg.norm(columns, axis=0).max()), 1e-12)
    rows = np.vstack((columns, np.full((1, columns.shape[1]), heavy)))
    # A triangular system with the same least squares: as many rows as members.
    basis, small = qr(rows, mode="economic")
    weights, _ = nnls(small, basis.T @ np.append(target, heavy))
    weights = np.where(weights < _NONE, 0.0, weights)
    return np.asarray(weights / weights.sum())
