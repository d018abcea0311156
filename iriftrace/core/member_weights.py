"""Weighted mean, scatter and uncertainty over the members of an ensemble."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from attrs import field, frozen
from numpy.typing import ArrayLike

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError


def _checked(values: ArrayLike) -> FloatArray:
    """Weights (k,) scaled to the sum 1; raises InputError unless finite, >= 0 and not all 0."""
    weights = np.array(values, dtype=np.float64)
    if not (np.isfinite(weights).all() and (weights >= 0.0).all() and weights.sum() > 0.0):
        listed = ", ".join(f"{weight:g}" for weight in weights)
        raise InputError(
            f"The weights {listed} are not those of an ensemble; give each member a finite number "
            "of 0 or more, and at least one of them more than 0.",
            code="ensemble.weights",
        )
    return np.asarray(weights / weights.sum())


def concentration(members: int) -> float:
    """Sum of the parameters of Dirichlet's distribution of the real air over members.

    With 2 / (n - 1) its variance is (n - 1) / (n + 1) of theirs, which is that of a state anywhere
    between members in equal steps of one quantity: two enclose it, and it is like one of many.
    """
    return 2.0 / (members - 1.0) if members > 1 else 1.0


@frozen(eq=False)
class MemberWeights:
    """Weights of an ensemble's members.

    Attributes
    ----------
    weights : (k,) array
        Not negative; their sum is 1.
    covariance : (k, k) array or None
        Covariance of weights that were fitted to a measurement (:func:`iriftrace.fit_members`);
        None for members that are a sample of the possible air.
    outside : str
        One sentence if the air that was measured is outside the members; else "".
    """

    weights: FloatArray = field(converter=_checked)
    covariance: FloatArray | None = None
    outside: str = ""

    @classmethod
    def of(
        cls, weights: Sequence[float], covariance: Sequence[Sequence[float] | None]
    ) -> MemberWeights:
        """Weights and the rows of their covariance, None where it is not known."""
        if any(row is None for row in covariance):
            return cls(weights)
        matrix = np.array(covariance, dtype=np.float64)
        if matrix.shape != (len(weights),) * 2:
            raise InputError(
                f"The covariance of {len(weights)} weights has the shape {matrix.shape}; write the "
                "scene again.",
                code="ensemble.covariance_shape",
            )
        return cls(weights, matrix)

    def of_places(self, places: Sequence[int]) -> MemberWeights:
        """Weights of some members, by their places from 0; the others have none."""
        rows = list(places)
        chosen = None if self.covariance is None else self.covariance[np.ix_(rows, rows)]
        return MemberWeights(self.weights[rows], chosen, self.outside)

    @property
    def rows(self) -> list[tuple[float, list[float] | None]]:
        """Weight of each member and its row of the covariance, None if that is not known."""
        weights = self.weights.tolist()
        known = [None] * len(weights) if self.covariance is None else self.covariance.tolist()
        return list(zip(weights, known, strict=True))

    @property
    def effective(self) -> float:
        """Effective number of members, 1 / sum w^2."""
        return float(1.0 / np.sum(self.weights**2))

    @property
    def equal(self) -> bool:
        """True if all members in the mean have the same weight."""
        return abs(self.effective - self.sampled) < 1e-6

    @property
    def sampled(self) -> int:
        """Number of members that the mean has; the others are variations of one of them."""
        return int(np.count_nonzero(self.weights))

    @property
    def several(self) -> bool:
        """True if the mean has more than one member."""
        return self.sampled > 1

    @property
    def of_mixtures(self) -> FloatArray:
        """Covariance (k, k) of the weights of the real air, as a mixture of the members.

        That of the fit; or else of Dirichlet's distribution with the mean of the weights and the
        `concentration` of as many members as are in the mean.
        """
        if self.covariance is not None:
            return self.covariance
        matrix = np.diag(self.weights) - np.outer(self.weights, self.weights)
        return np.asarray(matrix / (concentration(self.sampled) + 1.0))

    def mean(self, values: ArrayLike) -> FloatArray:
        """Weighted mean (...) of one value or array per member, (k, ...)."""
        return np.asarray(np.tensordot(self.weights, np.asarray(values), axes=1))

    def scatter(self, values: ArrayLike) -> FloatArray:
        """Weighted standard deviation (...) over the members' (k, ...) values.

        It is that of a sample, the root of ``sum w (x - mean)^2 / (1 - sum w^2)``, which for equal
        weights divides by k - 1; 0 if one member has all the weight.
        """
        numbers = np.asarray(values, dtype=np.float64)
        freedom = 1.0 - float(np.sum(self.weights**2))
        if freedom < 1e-12:
            return np.zeros(numbers.shape[1:])
        return np.asarray(np.sqrt(self.mean((numbers - self.mean(numbers)) ** 2) / freedom))

    def uncertainty(self, effects: ArrayLike) -> FloatArray:
        """Standard uncertainty (...) of the weighted mean as a statement about the real air.

        The root of ``x C x`` with the covariance C of the weights (`of_mixtures`). `effects` x
        (k, ...) are 0 without hot air: the C of a fit scales the air as a whole, too, so a size
        must be given as its difference from the measured one.
        """
        numbers = np.asarray(effects, dtype=np.float64)
        flat = numbers.reshape(len(numbers), -1)
        variance = np.einsum("in,in->n", flat, self.of_mixtures @ flat)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)).reshape(numbers.shape[1:]))
