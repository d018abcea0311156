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
