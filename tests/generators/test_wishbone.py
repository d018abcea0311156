"""The wishbone against its own dimensions."""

import numpy as np
import pytest

from iriftrace.core.errors import InputError
from iriftrace.part.part import Part
from scenes.generators.wishbone import REGIONS, WishboneShape, wishbone


@pytest.fixture(scope="module")
def part() -> Part:
    return wishbone()


def faces_of(part: Part, name: str) -> np.ndarray:
    return part.face_centres[part.region_of_face == part.region_names.index(name)]


def test_the_default_is_the_part_that_was_simulated(part: Part) -> None:
    """Volume, area and size of the surface around which the bundled field was solved."""
    assert part.closed
    assert part.region_names == REGIONS
    assert part.volume == pytest.approx(68089.09, abs=1.0)
    assert part.area == pytest.approx(23740.22, abs=0.5)
    assert np.ptp(part.bounds, axis=0) == pytest.approx((180.2403, 120.0314, 28.1559), abs=5e-3)


def test_bores_and_hubs_have_their_diameters(part: Part) -> None:
    """To a tenth of the lattice's spacing, halfway along the ball hub.

    Centred between its ends, the part has this hub at y = 42 and the bushes at -46.
    """
    hub = faces_of(part, "ball hub")
    across = np.hypot(hub[:, 0], hub[:, 1] - 42.0)
    middle = np.abs(hub[:, 2]) < 4.0
    inside = across[middle & (across < 14.0)]
    assert inside == pytest.approx(np.full(len(inside), 10.0), abs=0.125)
    # Away from the arms, which run into the hub from below in y.
    outside = across[middle & (across > 14.0) & (hub[:, 1] > 54.0)]
    assert outside == pytest.approx(np.full(len(outside), 18.0), abs=0.125)
    for name, side in (("bush -x", -75.0), ("bush +x", 75.0)):
        bush = faces_of(part, name)
        middle = np.abs(bush[:, 0] - side) < 6.0
        # Below and behind, away from the arm; the height of the bushes is half their diameter.
        low = part.bounds[0, 2] + 14.0
        across = np.hypot(bush[:, 1] + 46.0, bush[:, 2] - low)[middle]
        assert across[across < 11.0] == pytest.approx(8.0, abs=0.2)
        assert across[(across > 11.0) & (bush[middle, 1] < -46.0)] == pytest.approx(14.0, abs=0.2)


def test_a_finer_lattice_gives_the_same_solid(part: Part) -> None:
    """Volume from the signed distance by counting is independent of contour and smoothing."""
    shape = WishboneShape(150.0, 88.0, 9.0, 1.0, 18.0, 10.0, 14.0, 8.0)
    generator = np.random.default_rng(7)
    low, high = np.transpose(shape.extent)
    points = generator.uniform(low, high, (200_000, 3))
    inside = shape.distance(points) < 0.0
    box = float(np.prod(high - low))
    error = box * np.sqrt(inside.mean() * (1 - inside.mean()) / len(points))
    # Smoothing rounds the edges, which takes off some per mille.
    assert part.volume == pytest.approx(box * inside.mean(), abs=4 * error + 0.005 * 68089)


def test_dimensions_change_what_they_name() -> None:
    part = wishbone(170.0, 100.0, rise_mm=20.0, spacing_mm=2.5)
    assert part.closed
    assert np.ptp(part.bounds[:, 0]) == pytest.approx(200.0, abs=1.0)
    assert np.ptp(part.bounds[:, 1]) == pytest.approx(132.0, abs=1.0)
    assert (part.region_areas > 100.0).all()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"hub_bore_mm": 34.0}, "a wall has to be left around the bore"),
        ({"spacing_mm": 5.0}, "must be less than its"),
        ({"spacing_mm": 0.05}, "give a larger spacing"),
        ({"bush_distance_mm": 500.0, "spacing_mm": 2.5}, "separate pieces"),
        ({"depth_mm": 30.0}, "the arms need room between the hubs"),
        ({"thickness": float("nan")}, "give 0.5 to 3"),
        ({"rise_mm": -1.0}, "give 0 to 50 mm"),
    ],
)
def test_sizes_that_make_no_wishbone_are_refused(given: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        wishbone(**given)
