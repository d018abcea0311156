"""Colour scales are perceptually uniform, and those of magnitudes can be read in grey."""

import numpy as np
import pytest
from matplotlib import colormaps

from iriftrace.core.arrays import FloatArray
from iriftrace.figures.scene_picture import AIR_COLOUR_MAP
from iriftrace.figures.style import COLOUR_MAP, SIGNED_COLOUR_MAP

TO_XYZ = np.array(
    ((0.4124, 0.3576, 0.1805), (0.2126, 0.7152, 0.0722), (0.0193, 0.1192, 0.9505))
) / np.array(((0.9505,), (1.0,), (1.089,)))
"""Of linear sRGB, over the white of D65 (IEC 61966-2-1)."""


def lab(name: str) -> FloatArray:
    """(65, 3) array: CIELAB of a colour map from end to end."""
    rgb = colormaps[name](np.linspace(0.0, 1.0, 65))[:, :3]
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    xyz = linear @ TO_XYZ.T
    x, y, z = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116).T
    return np.stack((116 * y - 16, 500 * (x - y), 200 * (y - z)), axis=1)


def is_uniform(name: str) -> bool:
    """Steps of equal numbers differ in colour by 0.4 to 1.6 of their mean."""
    steps = np.linalg.norm(np.diff(lab(name), axis=0), axis=1)
    return bool(steps.min() > 0.4 * steps.mean() and steps.max() < 1.6 * steps.mean())


@pytest.mark.parametrize("name", [COLOUR_MAP, AIR_COLOUR_MAP])
def test_magnitudes_get_steadily_lighter(name: str) -> None:
    assert is_uniform(name)
    assert (np.diff(lab(name)[:, 0]) > 0.5).all()


def test_signed_values_get_steadily_darker_on_both_sides_of_0() -> None:
    assert is_uniform(SIGNED_COLOUR_MAP)
    lightness = lab(SIGNED_COLOUR_MAP)[:, 0]
    assert (np.diff(lightness[:33]) > 0.0).all()
    assert (np.diff(lightness[32:]) < 0.0).all()
    assert lightness[0] == pytest.approx(lightness[-1], abs=2.0)


def test_the_measure_knows_a_rainbow() -> None:
    assert not is_uniform("jet")
