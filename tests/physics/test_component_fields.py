"""Thirteen shells agree with the continuous engine at the poses of the bundled components."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.accuracy.fields import OWN, Case, lines_of, pictures
from benchmarks.component_fields import SOLVED, component_field
from iriftrace.continuous_cells import tetrahedra_of
from iriftrace.scenes.components import COMPONENTS


@pytest.mark.filterwarnings("ignore:only .* rays fall on each visible face")
@pytest.mark.parametrize("name", SOLVED)
@pytest.mark.usefixtures("variant")
def test_shells_and_field_agree_at_the_scenes_own_pose(name: str, tmp_path: Path) -> None:
    case = Case(name, {OWN: COMPONENTS[name].origin_mm})
    images = pictures(tmp_path, case, (13,))[OWN]
    lines, _ = lines_of(name, images, (13,), bounded=True)
    assert sum(line.bound is not None for line in lines) == 2
    assert [line for line in lines if not line.holds] == []


def test_mirror_images_join_what_was_solved(tmp_path: Path) -> None:
    """No gap at the planes of symmetry; cells of one hand, but for folds of the solver's mesh."""
    field = component_field("bevel_gear", tmp_path)
    points = np.asarray(field.grid.points, dtype=np.float64)
    found = tetrahedra_of(field.grid)
    faces = points[found.boundary.astype(np.int64)]
    in_a_plane = (np.abs(faces[:, :, :2]) < 1e-6).all(axis=1)
    assert not in_a_plane.any()
    corners = points[found.corners.astype(np.int64)]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1])
    assert 0 < (volume < 0).mean() < 0.01
    assert -volume[volume < 0].sum() < 1e-4 * volume.sum()
