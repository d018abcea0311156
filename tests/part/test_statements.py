"""The figures behind docs/parts.md, on a sweep small enough to do by hand."""

import numpy as np
import pytest
import xarray as xr

from iriftrace.part.standards import cylinder
from validation.statements.finding import verdict
from validation.statements.orbit import Swept
from validation.statements.wishbone import curvature


def swept() -> Swept:
    """Pose 0 looks from +x and sees faces 0 and 1, pose 1 from above and sees face 1."""
    part = cylinder()
    matrices = np.tile(np.eye(4), (2, 1, 1))
    matrices[:, :3, 2] = ((-1.0, 0.0, 0.0), (0.0, 0.0, -1.0))
    dataset = xr.Dataset(
        {
            "matrix": (("pose", "row", "column"), matrices),
            "sightings": ("pose", [2, 1]),
            "sighting_face": ("sighting", [0, 1, 1]),
            "sighting_rays": ("sighting", [10, 1, 30]),
            "sighting_displacement": ("sighting", [1e-3, 2e-3, 5e-3]),
            "sighting_incidence": ("sighting", [10.0, 80.0, 20.0]),
        }
    )
    return Swept(part, dataset)


def test_medians_count_rays_and_keep_to_poses_faces_and_angles() -> None:
    case = swept()
    faces = np.ones(len(case.part.faces), dtype=bool)
    both = np.ones(2, dtype=bool)
    assert case.on_faces_um(faces, both) == pytest.approx(5.0)
    assert case.on_faces_um(faces, case.beside_plume) == pytest.approx(1.0)
    assert case.on_faces_um(faces, both, (60.0, 90.0)) == pytest.approx(2.0)
    assert case.on_faces_um(np.arange(len(faces)) == 0, both) == pytest.approx(1.0)
    medians = case.face_medians_um(both)
    assert medians[:2] == pytest.approx((1.0, 3.5))
    assert np.isnan(medians[2:]).all()


def test_directions_are_those_of_the_lines_of_sight() -> None:
    case = swept()
    assert case.elevation_deg == pytest.approx((0.0, 90.0))
    assert case.angle_to((1.0, 0.0, 0.0)) == pytest.approx((0.0, 90.0))
    assert case.beside_plume.tolist() == [True, False]


def test_curvature_of_a_cylinder_is_one_over_its_radius() -> None:
    """The normal turns by 6 degrees a strip; centres of its halves are 2/3 of a strip apart."""
    part = cylinder(segments=60)
    lateral = np.abs(part.face_centres[:, 0]) < 60.0
    radius = 1.0 / curvature(part)[lateral & (np.hypot(*part.face_centres[:, 1:].T) > 13.0)]
    assert radius == pytest.approx(np.full(len(radius), 2 / 3 * 13.5), rel=1e-3)
    flat = curvature(part)[(np.hypot(*part.face_centres[:, 1:].T) < 8.0)]
    assert flat == pytest.approx(np.zeros(len(flat)), abs=1e-6)


def test_what_holds_beside_the_plume_only_is_said_so() -> None:
    assert verdict(True, True) == "yes"
    assert verdict(False, False) == "no"
    assert "not looking down" in verdict(False, True)
    assert "only with" in verdict(True, False)
