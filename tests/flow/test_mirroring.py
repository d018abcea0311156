"""Halves that become wholes."""

import numpy as np
import pytest
import pyvista as pv
import trimesh

from iriftrace.flow.simulate.part_surface import mirrored_grid, symmetric_axes
from iriftrace.part.part import Part
from validation.inputs.parts import part_from

CELLS = {
    10: [(1, 0, 0), (1, 1, 0), (1, 0, 1), (0, 0, 0)],
    12: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
    13: [(0, 0, 0), (0, 1, 0), (1, 0, 0), (0, 0, 1), (0, 1, 1), (1, 0, 1)],
    14: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 1)],
}


def test_axes_of_a_cylinder_and_of_a_crooked_part(cylinder: Part) -> None:
    assert symmetric_axes(cylinder) == "xy"
    wedge = trimesh.creation.box((10.0, 10.0, 10.0))
    wedge.vertices[wedge.vertices[:, 0] > 0] *= (1.0, 0.5, 1.0)
    assert symmetric_axes(part_from(wedge)) == "y"


def plate_with_hole(x: float, y: float, radius: float) -> trimesh.Trimesh:
    """200 x 100 x 2 mm; its corners lie on the rims of plate and hole, and not between them."""
    half, centre = np.array((100.0, 50.0)), np.array((x, y))
    toward = [np.array((sx, sy)) * half - centre for sx in (-1, 1) for sy in (-1, 1)]
    angles = np.sort([*np.linspace(-3.1, 3.1, 24), *(np.arctan2(v, u) for u, v in toward)])
    ways = np.column_stack((np.cos(angles), np.sin(angles)))
    to_edge = ((np.sign(ways) * half - centre) / ways).min(axis=1)
    rims = [centre + radius * ways, centre + to_edge[:, None] * ways]
    rings = [np.column_stack((rim, np.full(len(rim), z))) for z in (-1.0, 1.0) for rim in rims]
    here, count = np.arange(len(angles)), len(angles)
    following = (here + 1) % count
    faces = []
    for a, b in ((0, 1), (1, 3), (3, 2), (2, 0)):  # bottom, edge, top, hole
        a, b = a * count, b * count
        faces += [np.column_stack((a + here, a + following, b + here))]
        faces += [np.column_stack((a + following, b + following, b + here))]
    return trimesh.Trimesh(np.concatenate(rings), np.concatenate(faces))


@pytest.mark.parametrize(("x", "y", "radius"), [(40.0, 20.0, 8.0), (40.0, 0.0, 2.0)])
def test_a_hole_in_a_thin_plate_has_no_image(x: float, y: float, radius: float) -> None:
    """Every corner of its rim has an image on the plate, though not what lies around the hole."""
    mesh = plate_with_hole(x, y, radius)
    assert mesh.is_watertight
    assert symmetric_axes(part_from(mesh)) == ("" if y else "y")
    assert symmetric_axes(part_from(plate_with_hole(0.0, 0.0, radius))) == "xy"


@pytest.mark.parametrize("kind", sorted(CELLS))
@pytest.mark.parametrize("axis", [0, 1])
def test_mirrored_cells_keep_their_volume_and_sense(kind: int, axis: int) -> None:
    """The volume that VTK computes has a sign, which a cell turned inside out would lose."""
    points = np.array(CELLS[kind], dtype=float) + 3.0
    half = pv.UnstructuredGrid({kind: np.arange(len(points))[None]}, points)
    half.point_data["T"] = np.arange(len(points), dtype=float)
    whole = mirrored_grid(half, axis, 3.0)
    one = half.compute_cell_sizes()["Volume"][0]
    assert whole.compute_cell_sizes()["Volume"] == pytest.approx([one, one])
    on_plane = int((points[:, axis] == 3.0).sum())
    assert whole.n_points == 2 * len(points) - on_plane, "points in the plane are shared"
    image = np.asarray(whole.points).copy()
    image[:, axis] = 6.0 - image[:, axis]
    for point, value in zip(image, whole.point_data["T"], strict=True):
        twin = np.linalg.norm(np.asarray(whole.points) - point, axis=1).argmin()
        assert whole.point_data["T"][twin] == value
