"""Fields of which the tree keeps what was solved: their mirror images join without a gap."""

from pathlib import Path

import numpy as np
import pytest

from iriftrace.medium.tetrahedra import tetrahedra_of
from validation.inputs.solved_fields import SOLVED


@pytest.mark.slow
def test_mirror_images_join_what_was_solved(tmp_path: Path) -> None:
    """At the planes of symmetry; cells of one hand, but for folds of the solver's mesh."""
    field = SOLVED["bevel_gear"].field(tmp_path)
    points = np.asarray(field.grid.points, dtype=np.float64)
    found = tetrahedra_of(field.grid)
    faces = points[found.boundary.astype(np.int64)]
    in_a_plane = (np.abs(faces[:, :, :2]) < 1e-6).all(axis=1)
    assert not in_a_plane.any()
    corners = points[found.corners.astype(np.int64)]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1])
    assert 0 < (volume < 0).mean() < 0.01
    assert -volume[volume < 0].sum() < 1e-4 * volume.sum()
