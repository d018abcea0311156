"""Weights of predicted shifts and noise of measured ones, against closed forms."""

import numpy as np
import pytest

from iriftrace.core.errors import InputError
from iriftrace.measuring.fit.shift_mixture import ShiftMixture, simplex_weights
from iriftrace.measuring.fit.shift_noise import shift_noise


def test_weights_are_the_least_squares_on_the_simplex() -> None:
    """Against the optimality conditions: the gradient is equal where w > 0 and larger where not."""
    random = np.random.default_rng(4)
    columns, target = random.normal(size=(40, 6)), random.normal(size=40)
    weights = simplex_weights(columns, target)
    assert weights.sum() == pytest.approx(1.0, abs=1e-12)
    gradient = columns.T @ (columns @ weights - target)
    level = gradient[weights > 0].mean()
    np.testing.assert_allclose(gradient[weights > 0], level, atol=1e-5)
    assert (gradient[weights == 0] > level).all()
    assert 0 < (weights == 0).sum() < 5
    mixture = np.array((0.0, 0.25, 0.0, 0.75, 0.0, 0.0))
    np.testing.assert_allclose(simplex_weights(columns, columns @ mixture), mixture, atol=1e-7)


def test_contrast_is_as_uncertain_as_single_dots() -> None:
    """Half of the dots move by a fifth of the others and are off by 30 % of that."""
    predicted = np.zeros((1, 200, 2))
    predicted[0, :100, 0], predicted[0, 100:, 0] = 5.0, 1.0
    off = np.where(np.arange(200) < 100, 0.0, 0.3 * (-1.0) ** np.arange(200))
    fit = ShiftMixture(predicted, predicted[0] * (1.0 + off)[:, None])
    assert np.sqrt(fit.covariance(1e-6)[0, 0]) == pytest.approx(0.3 / np.sqrt(2.0), rel=1e-6)


def test_noise_is_told_from_the_signal() -> None:
    random = np.random.default_rng(5)
    places = random.uniform(0.0, 1000.0, (2000, 2))
    x, y = places.T / 1000.0
    signal = np.column_stack((3.0 * x**2 - y, np.sin(4.0 * x) * y))
    noisy = signal + random.normal(0.0, 0.08, signal.shape)
    assert shift_noise(places, noisy) == pytest.approx(0.08, rel=0.05)
    assert shift_noise(places, signal) < 0.002
    with pytest.raises(InputError, match="state it"):
        shift_noise(places[:10], signal[:10])
