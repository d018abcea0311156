"""Layered slab and hot cylinder against their exact solutions, by Snell's and Bouguer's laws."""

from pathlib import Path

import numpy as np
import pytest

from iriftrace.medium.shells.levels import index_levels
from iriftrace.plugins.first_hit import BENDING
from iriftrace.scenes.analytic import cylinder_radii
from iriftrace.scenes.closed_forms import CYLINDER_UM, SLAB_SHIFT_UM, WALL_K
from iriftrace.tracing.rays import RayHits
from validation.oracles.exact_layers import RoundAir, layered_cylinder_displacement_um
from validation.sections.exact_shells import cylinder_hits, displacements_um, slab_hits, usual_hits

LAYERS = (13, 26, 100)
EXACT_UM = np.array(list(CYLINDER_UM.values()))


@pytest.fixture(scope="module")
def slab(variant: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, RayHits]:
    return slab_hits(tmp_path_factory.mktemp("slab"))


@pytest.fixture(scope="module")
def cylinders(
    variant: str, tmp_path_factory: pytest.TempPathFactory
) -> dict[int, dict[str, RayHits]]:
    """By number of shells and where they bend; ``"equal"`` in layers of equal steps."""
    found = {}
    for n in LAYERS:
        folder = tmp_path_factory.mktemp(f"cylinder_{n}")
        found[n] = usual_hits(folder, n)
        if n < LAYERS[-1]:
            found[n]["equal"] = cylinder_hits(folder / "equal", n, "midpoint", "layers")
    return found


def errors_of(hits: RayHits) -> dict[float, float]:
    """Relative error of the displacement at each height of the ray over the axis."""
    return dict(zip(CYLINDER_UM, displacements_um(hits) / EXACT_UM - 1, strict=True))


@pytest.mark.parametrize("bending", BENDING)
def test_slab_of_200_layers_shifts_rays_as_snell_demands(
    slab: dict[str, RayHits], bending: str
) -> None:
    hits = slab[bending]
    shift_um = hits.displacement * 1e3
    np.testing.assert_array_equal(hits.crossings, 200)
    np.testing.assert_allclose(shift_um[:, 0], list(SLAB_SHIFT_UM.values()), rtol=1e-4)
    np.testing.assert_allclose(shift_um[:, 1:], 0, atol=1e-9)


@pytest.mark.parametrize("bending", BENDING)
@pytest.mark.parametrize("layers", LAYERS)
def test_rays_to_the_cylinder_cross_every_shell(
    cylinders: dict[int, dict[str, RayHits]], layers: int, bending: str
) -> None:
    hits = cylinders[layers][bending]
    assert (hits.status == 0).all()
    np.testing.assert_array_equal(hits.crossings, layers)


@pytest.mark.parametrize("bending", ["equal", "shells"])
def test_cylinder_converges_at_second_order(
    cylinders: dict[int, dict[str, RayHits]], bending: str
) -> None:
    found = {layers: hits for layers, hits in cylinders.items() if bending in hits}
    errors = {layers: errors_of(hits[bending]) for layers, hits in found.items()}
    least_gain = {0.25: 3.2, 0.75: 3.2, 0.95: 2.2}
    for b in least_gain:
        assert abs(errors[13][b]) < 0.007
        assert bending == "equal" or abs(errors[100][b]) < 0.0005
        assert abs(errors[13][b] / errors[26][b]) > least_gain[b]


def test_layers_of_thirteen_shells_err_half_as_much_near_the_silhouette(
    cylinders: dict[int, dict[str, RayHits]],
) -> None:
    """Where a ray runs along a layer, the law at its surface is not enough."""
    errors = {way: errors_of(hits) for way, hits in cylinders[13].items()}
    for way in ("layers", "equal"):
        assert abs(errors[way][0.95]) < 0.55 * abs(errors["shells"][0.95])
        assert all(abs(error) < 0.001 for error in errors[way].values())
    assert all(abs(error) < 0.0005 for error in errors_of(cylinders[100]["layers"]).values())


@pytest.mark.parametrize("layers", LAYERS)
def test_snells_law_at_facets_errs_as_at_exact_circles(
    cylinders: dict[int, dict[str, RayHits]], layers: int
) -> None:
    """The law of sines at circles of the shells' radii, and nothing of what facets do."""
    air = RoundAir()
    hottest = float(air.refractivity(WALL_K))
    surfaces, e = index_levels(air.ambient_refractivity, hottest, layers, "midpoint")
    radii = cylinder_radii(surfaces, air)
    for b, error in errors_of(cylinders[layers]["shells"]).items():
        circles = layered_cylinder_displacement_um(b, radii, e) / CYLINDER_UM[b] - 1
        if b < 0.999:
            assert error == pytest.approx(circles, rel=0.05, abs=3e-5)


def test_shells_midway_between_layers_are_nearer_and_graded_steps_nearest(
    cylinders: dict[int, dict[str, RayHits]], tmp_path: Path
) -> None:
    """13 shells that bend rays by each rule; with shells at the layers' own index several per cent
    are missing.
    """
    hits = {"midpoint": cylinders[13]["shells"]}
    for rule in ("graded", "outer"):
        hits[rule] = cylinder_hits(tmp_path / rule, 13, rule, "shells")
    error = {rule: np.abs(displacements_um(found) / EXACT_UM - 1) for rule, found in hits.items()}
    assert (error["graded"] < error["midpoint"]).all()
    assert (error["midpoint"] < 0.2 * error["outer"]).all()
    assert 0.03 < error["outer"][1] < 0.08
