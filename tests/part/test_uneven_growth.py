"""A part that is not equally hot everywhere, against closed forms of free thermal expansion."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from iriftrace.core.errors import InputError
from iriftrace.io.part_files import read_part, save_part
from iriftrace.io.reading import ReadPart
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.part.standards import cylinder
from iriftrace.part.tessellation import subdivide_part
from iriftrace.part.uneven_growth import grown_unevenly

ALPHA, COLD = 14e-6, 293.15


def bar(edge_mm: float) -> Part:
    """100 x 20 x 20 mm."""
    import trimesh

    mesh = trimesh.creation.box((100.0, 20.0, 20.0))
    return subdivide_part(part_of_mesh(mesh.vertices, mesh.faces, name="bar"), edge_mm)


def grown(part: Part, kelvins: Callable[[np.ndarray], np.ndarray]) -> Part:
    return grown_unevenly(part, ALPHA, COLD, lambda points: COLD + kelvins(points), (1.0, 2.0, 3.0))


def test_an_equally_hot_part_keeps_its_shape() -> None:
    part = bar(20.0)
    hot = grown(part, lambda points: np.full(len(points), 1000.0))
    about = np.array((1.0, 2.0, 3.0))
    np.testing.assert_allclose(hot.vertices, about + 1.014 * (part.vertices - about), atol=1e-9)
    assert hot.growth is not None
    assert hot.growth.factor == pytest.approx(1.014)


def test_a_bar_that_is_hotter_above_bends_without_stress() -> None:
    """T = b z: u = a b (x z, y z, (z^2 - x^2 - y^2) / 2), Timoshenko and Goodier, section 153."""
    part, slope = bar(5.0), 20.0
    hot = grown(part, lambda points: slope * points[:, 2])
    x, y, z = part.vertices.T
    u = ALPHA * slope * np.column_stack((x * z, y * z, (z**2 - x**2 - y**2) / 2.0))
    expected = part.vertices + u
    here, there = (places - places.mean(axis=0) for places in (hot.vertices, expected))
    moved = Rotation.align_vectors(there, here)[0].apply(here)
    assert np.ptp(u[:, 2]) > 0.3
    assert np.abs(moved - there).max() < 0.02 * np.ptp(u[:, 2])


def test_a_cylinder_that_is_hotter_inside_grows_by_its_mean_temperature() -> None:
    """T = T0 (1 - r^2/R^2): the radius grows by a T0 / 2, Timoshenko and Goodier, section 151."""
    part = cylinder(diameter_mm=30.0, length_mm=120.0)
    hot = grown(part, lambda points: 1000.0 * (1.0 - np.sum(points[:, 1:] ** 2, axis=1) / 225.0))
    far = np.abs(part.vertices[:, 0]) < 25.0
    far &= np.hypot(*part.vertices[:, 1:].T) > 14.9
    radii = [
        np.hypot(*(each[far, 1:] - each[far, 1:].mean(axis=0)).T)
        for each in (part.vertices, hot.vertices)
    ]
    assert far.sum() > 20
    assert np.mean(radii[1] / radii[0]) - 1.0 == pytest.approx(ALPHA * 500.0, rel=0.03)


def test_the_drawing_travels_with_the_file(tmp_path: Path) -> None:
    part = bar(20.0)
    hot = grown(part, lambda points: 5.0 * points[:, 0] + 600.0)
    save_part(hot, tmp_path / "hot.ply")
    matrix = np.array(((0.0, -1, 0, 5), (1, 0, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)))
    again = read_part(tmp_path / "hot.ply", ReadPart(transform=matrix))
    assert again.growth == hot.growth
    assert again.drawing is not None
    cold = part.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    np.testing.assert_allclose(again.drawing, cold, atol=1e-5)
    with pytest.raises(InputError, match="is expanded already"):
        grown(again, lambda points: points[:, 0])
    with pytest.raises(InputError, match="no place in its drawing"):
        subdivide_part(again, 2.0)
    even = read_part(tmp_path / "hot.ply")
    assert subdivide_part(read_part_even(tmp_path, even), 2.0).growth == even.growth


def read_part_even(folder: Path, part: Part) -> Part:
    """The same growth without a drawing, as of a part that is equally hot."""
    text = (folder / "hot.ply").read_bytes().replace(b"drawing_1", b"further_1")
    (folder / "even.ply").write_bytes(text)
    return read_part(folder / "even.ply")


def test_temperatures_that_are_not_finite_are_refused() -> None:
    with pytest.raises(InputError, match="to nan K"):
        grown(bar(20.0), lambda points: np.full(len(points), np.nan))
