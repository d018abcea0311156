"""The closed forms that the tracer is checked with, against values of 30-digit quadrature."""

import pytest

from iriftrace.medium.shells.levels import index_levels
from iriftrace.scenes.analytic import cylinder_radii
from validation.oracles.closed_forms import (
    CYLINDER_UM,
    REFRACTIVITY,
    SLAB_SHIFT_UM,
    WALL_K,
    RoundAir,
    layered_cylinder_displacement_um,
    refractivity,
)
from validation.oracles.media import AIR_PARABOLA_UM


def test_slab_cylinder_and_parabola() -> None:
    assert SLAB_SHIFT_UM == pytest.approx({15: 0.906732, 60: 21.891213, 85: 4921.029686}, rel=1e-6)
    assert CYLINDER_UM == pytest.approx(
        {0.25: 0.484096, 0.75: 2.430121, 0.95: 7.621401, 0.999: 67.019772}, rel=1e-6
    )
    assert AIR_PARABOLA_UM == pytest.approx(
        {100: 49.986414, 200: 199.945655, 500: 1249.660342}, rel=1e-8
    )


@pytest.mark.parametrize(
    ("layers", "per_cent"),
    [(5, (1.45, 1.67, 1.42)), (13, (0.265, 0.406, 0.561)), (26, (0.069, 0.120, 0.244))],
)
def test_concentric_shells_err_by(layers: int, per_cent: tuple[float, ...]) -> None:
    surfaces, e = index_levels(REFRACTIVITY, refractivity(WALL_K), layers, "midpoint")
    radii = cylinder_radii(surfaces, RoundAir())
    for b, expected in zip((0.25, 0.75, 0.95), per_cent, strict=True):
        found = layered_cylinder_displacement_um(b, radii, e) / CYLINDER_UM[b] - 1
        assert 100 * found == pytest.approx(expected, abs=0.006)
