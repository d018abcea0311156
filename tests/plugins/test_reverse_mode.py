"""Reverse mode through the loops that trace rays: its bound, and primal results without change."""

import re
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
import trimesh

from iriftrace.core.errors import InputError
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.part.part import part_of_mesh
from iriftrace.plugins.kernels.vertex_table import aligned_rows
from iriftrace.tracing.hot_air import AirState
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.scene import Scene
from iriftrace.tracing.write import write_scene
from validation.inputs.cameras import camera_at
from validation.inputs.shell_fields import sphere_field

pytestmark = pytest.mark.usefixtures("variant")

CAMERA = camera_at((0.0, -60.0, 5.0), resolution=(64, 60))


@pytest.fixture(scope="module")
def xml(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ball in air that is hottest in its centre, with 8 shells and the field itself."""
    ball = trimesh.creation.icosphere(2, 4.0)
    field = sphere_field(10)
    return write_scene(
        tmp_path_factory.mktemp("ball"),
        part_of_mesh(ball.vertices, ball.faces, name="ball"),
        AirState(field, ready=contour_shells(field, 8)),
        CAMERA,
        paraview=False,
    )


@pytest.fixture(scope="module", params=["shells at shells", "shells in layers", "cells"])
def scene(request: pytest.FixtureRequest, xml: Path) -> Scene:
    engine, _, bending = request.param.partition(" ")
    values = {"bending": "shells"} if bending == "at shells" else {}
    return load_scene(xml, values, engine=engine)


def bent(scene: Scene, moved: Any = 0.0) -> Any:
    """Ends of the camera's rays, whose origins are moved along x."""
    integrator = scene.compiled.integrator
    origins, directions = CAMERA.rays()
    origin = mi.Point3d(*aligned_rows(origins)) + mi.Vector3d(moved, 0, 0)
    bend = integrator.bender(integrator.prepare(scene.compiled.mitsuba_scene), False)
    return bend(origin, mi.Vector3d(*aligned_rows(directions)))


def gradient(scene: Scene, passes: int) -> float:
    """Derivative of the sum of the hits' x on the part by a motion of the camera along x."""
    scene.compiled.integrator.reverse_passes = passes
    moved = mi.Float64(0.0)
    dr.enable_grad(moved)
    hits = bent(scene, moved)
    dr.backward(dr.sum(dr.select(hits.outcome == 1, hits.point.x, 0)))
    return float(dr.grad(moved)[0])


def test_stored_passes_change_no_bit_of_the_hits(scene: Scene) -> None:
    ends = []
    for passes in (None, 1000, 65_536):
        scene.compiled.integrator.reverse_passes = passes
        hits = bent(scene)
        dr.eval(*hits)
        ends.append(hits)
    for name in ends[0]._fields:
        values = [np.array(getattr(hits, name)) for hits in ends]
        np.testing.assert_array_equal(values[1], values[0])
        np.testing.assert_array_equal(values[2], values[0])
    assert np.count_nonzero(np.array(ends[0].outcome) == 1) > 100


def test_too_few_passes_are_an_error_instead_of_a_wrong_gradient(scene: Scene) -> None:
    """The bound that the message names is enough, and one less is not."""
    with pytest.raises(InputError, match="reverse_passes of the integrator is 2") as caught:
        gradient(scene, 2)
    enough = int(re.findall(r"at least ([\d,]+)", str(caught.value))[0].replace(",", ""))
    assert gradient(scene, enough) == pytest.approx(gradient(scene, 1000), rel=1e-9) != 0
    with pytest.raises(InputError, match=f"takes {enough} passes"):
        gradient(scene, enough - 1)


@pytest.mark.parametrize("kind", ["first_hit", "gradient_path"])
def test_more_passes_than_dr_jit_can_store_are_refused(kind: str) -> None:
    mi.load_dict({"type": kind, "reverse_passes": 65_536})
    with pytest.raises(RuntimeError) as caught:
        mi.load_dict({"type": kind, "reverse_passes": 65_537})
    assert '"reverse_passes" is 65,537' in str(caught.value.__cause__ or caught.value)
