"""Thirteen shells agree with the continuous engine in the fields of the accuracy page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from iriftrace.field.tetrahedra import tetrahedra_of
from iriftrace.scenes.components import COMPONENTS
from validation.inputs.solved_fields import SOLVED
from validation.sections import resolutions
from validation.sections.fields import Case, cases, lines_of, pictures


@pytest.mark.filterwarnings("ignore:only .* rays fall on each visible face")
@pytest.mark.parametrize("name", [*COMPONENTS, "cylinder_B"])
@pytest.mark.usefixtures("variant")
def test_shells_and_field_agree(name: str, tmp_path: Path) -> None:
    (case,) = (case for case in (*cases(), resolutions.case("cylinder_B")) if case.name == name)
    view = next(iter(case.views))
    alone = Case(name, {view: case.views[view]})
    lines, _ = lines_of(name, pictures(tmp_path, alone, (13,))[view], (13,), bounded=True)
    assert sum(line.bound is not None for line in lines) == 2
    assert [line for line in lines if not line.holds] == []


def test_mirror_images_join_what_was_solved(tmp_path: Path) -> None:
    """No gap at the planes of symmetry; cells of one hand, but for folds of the solver's mesh."""
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
