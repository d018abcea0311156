"""A cloud of the hot part against the drawing: how much larger it is, and where that is not so."""

import re

import numpy as np
import pytest
from attrs import evolve
from scipy.spatial.transform import Rotation

from iriftrace.core.arrays import FloatArray
from iriftrace.io.part_files import read_part
from iriftrace.measuring.two_devices.larger import larger_than
from iriftrace.part.growth import Growth
from iriftrace.part.part import Part
from iriftrace.scenes import folder_of

PART = read_part(folder_of("cylinder") / "part.ply")


def scanned(part: Part, scale: float) -> FloatArray:
    """One side of a part of another size, not well aligned, with noise, outliers and a table."""
    rng = np.random.default_rng(1)
    places, face = part.surface.even_places(12000)
    points = scale * places[part.face_normals[face] @ (0.0, -0.86, 0.51) > 0.2]
    points = Rotation.from_rotvec((2e-3, -1e-3, 1e-3)).apply(points) + np.array((0.1, -0.05, 0.08))
    points += rng.normal(0, 0.01, points.shape)
    points[::30] += rng.normal(0, 0.5, points[::30].shape)
    table = rng.uniform((-200, -200, -60), (200, 200, -60), (20000, 3))
    return np.vstack((points, table))


@pytest.mark.parametrize(
    ("scale", "said", "argument"),
    [
        (
            1.0144,
            r"1\.4. % larger than the part .*steel is at 10[45]. degC.*an expansion of 14e-6/K",
            "hot_temperature",
        ),
        (0.99, r"1\.0. % smaller .* check the part and the unit", "length_unit"),
        (1.0, None, None),
    ],
)
def test_a_cloud_of_another_size_is_noticed(
    scale: float, said: str | None, argument: str | None
) -> None:
    found = larger_than(scanned(PART, scale), PART)
    if said is None:
        assert found is None
        return
    assert found is not None
    assert found.scale == pytest.approx(scale, abs=2e-4)
    assert found.left_mm < 0.01 < 2 * found.rigid_mm
    text, mends = found.remark(None)
    assert re.search(said, text)
    assert mends == argument


def test_of_an_expanded_part_the_temperature_is_corrected() -> None:
    """Steel that was expanded to 500 degC and is 1050 degC hot."""
    growth = Growth(14e-6, 293.15, 773.15)
    part = evolve(PART.transformed(np.diag([growth.factor] * 3 + [1.0])), growth=growth)
    found = larger_than(scanned(PART, 1.01442), part)
    assert found is not None
    text, argument = found.remark(part.growth)
    assert argument == "hot_temperature"
    assert "0.7" in text
    assert "than the part at 500 degC" in text
    hot = float(text.split("as it is at ")[1].split()[0])
    assert hot == pytest.approx(1050, abs=20)


def test_a_plane_tells_no_size() -> None:
    """Of one face in the plane a scale shows at its edges alone."""
    places, face = PART.surface.even_places(20000)
    head = places[PART.face_normals[face] @ (1.0, 0.0, 0.0) > 0.9]
    inner = head[np.linalg.norm(head[:, 1:], axis=1) < 10.0]
    assert larger_than(1.01 * inner, PART) is None
