"""Shells that a user of Mitsuba makes: openings, lengths of derivatives, empty and missing ones."""

from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
import trimesh

import iriftrace
from iriftrace import trace_rays
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.image.aov_image import Status
from iriftrace.medium.shells.hessian import HESSIAN_AXES
from iriftrace.plugins.kernels.tables import SceneTables, is_closed
from validation.inputs.small_scenes import (
    camera,
    channels,
    nested_spheres,
    part,
    scene,
    shell,
    sphere,
)

pytestmark = pytest.mark.usefixtures("variant")

BALL = trimesh.creation.icosphere(subdivisions=4, radius=30.0)
VERTICES, FACES = np.float32(BALL.vertices), np.uint32(BALL.faces)


def test_openings_that_balance_each_other_are_openings() -> None:
    """Six equal ones, as where a ball of hot air leaves a cube of data, break no integral."""
    inside = np.abs(VERTICES[FACES].mean(axis=1)).max(axis=1) < 27.0
    assert not is_closed(VERTICES, FACES[inside])


def test_closed_surfaces_are_closed_however_they_are_stored() -> None:
    assert is_closed(VERTICES, FACES)
    corners = VERTICES[FACES].reshape(-1, 3)
    assert is_closed(corners, np.arange(len(corners), dtype=np.uint32).reshape(-1, 3))
    assert is_closed(np.where(VERTICES == 0, np.float32(-0.0), VERTICES), FACES)


def test_a_surface_without_a_hemisphere_or_with_a_turned_one_is_open() -> None:
    above = VERTICES[FACES].mean(axis=1)[:, 2] > 0.0
    assert not is_closed(VERTICES, FACES[above])
    assert not is_closed(VERTICES, np.where(above[:, None], FACES, FACES[:, ::-1]))


def tables_of(scale: float, radius: float = 30.0) -> SceneTables:
    """A shell of index 1/r, made `scale` times as large without its derivatives."""
    unit = np.asarray(BALL.vertices) / 30.0
    properties = mi.Properties()
    properties.set_id("shell_1")
    bsdf = {"type": "iso_shell", "ext_ior": 1.0003, "int_ior": 1.0002}
    properties["mesh_bsdf"] = mi.load_dict(bsdf)
    mesh = mi.Mesh("shell_1", len(unit), len(FACES), properties, has_vertex_normals=True)
    values = mi.traverse(mesh)
    values["vertex_positions"] = mi.Float(scale * radius * unit.ravel())
    values["vertex_normals"] = mi.Float(unit.ravel())
    values["faces"] = mi.UInt32(FACES.ravel())
    values.update()
    slope = 0.1 / radius
    mesh.add_attribute("vertex_gradient", 3, mi.Float(slope * unit.ravel()))
    for name, (i, j) in HESSIAN_AXES.items():
        second = slope / radius * ((i == j) - 3.0 * unit[:, i] * unit[:, j])
        mesh.add_attribute(f"vertex_{name}", 1, mi.Float(second))
    content = {"type": "scene", "part": {"type": "cube"}, "shell_1": mesh}
    return SceneTables(mi.load_dict(content, optimize=False))


@pytest.mark.parametrize("scale", [0.001, 0.1, 10.0, 25.4, 1000.0])
def test_derivatives_in_another_unit_than_the_shells_are_refused(scale: float) -> None:
    """As after a to_world of a file in metres; all rays were good, and wrong by that factor."""
    with pytest.raises(InputError, match=r"all lengths .* times as large: divide") as caught:
        tables_of(scale)
    stated = float(str(caught.value).split("all lengths ")[1].split()[0])
    assert stated == pytest.approx(scale, rel=0.02)


@pytest.mark.parametrize("radius", [0.03, 30.0, 30_000.0])
def test_derivatives_in_the_unit_of_the_shells_are_accepted(radius: float) -> None:
    assert tables_of(1.0, radius).knows_derivatives


INDICES = (1.000272, 1.000247, 1.000222, 1.000197, 1.000172)


def four_shells(folder: Path, *left_out: int, radius: float = 10.0) -> dict[str, Any]:
    """A ball in four shells of equal steps, without some of them."""
    shells = nested_spheres(folder, (25.0, 20.0, 16.0, 13.0), INDICES)
    for number in left_out:
        del shells[f"shell_{number}"]
    return {"part": part(folder, sphere(radius)), **shells}


@pytest.mark.parametrize("missing", [2, 3])
def test_a_shell_that_is_missing_between_others_is_warned_of(tmp_path: Path, missing: int) -> None:
    """Displacements are too small by its step, and no ray showed it: straight lines from the wall,
    by which the layer there is counted, miss the same step."""
    loaded = scene(four_shells(tmp_path, missing))
    between = rf"no shell between the layers of index {INDICES[missing - 1]:.9g} and "
    with pytest.warns(IriftraceWarning, match=rf"{between}{INDICES[missing]:.9g}, "):
        mi.render(loaded)
    status = channels(loaded)["status.code"]
    hit = np.isin(status, (Status.GOOD, Status.INDEX_MISMATCH))
    assert hit.sum() > 100
    assert (status[hit] == Status.INDEX_MISMATCH).all()
    with pytest.warns(IriftraceWarning, match=between):
        own = iriftrace.from_mitsuba(loaded)
    hits = trace_rays(own, [(1.0, -100.0, 2.0)], [(0.0, 1.0, 0.0)])
    assert hits.status[0] == Status.INDEX_MISMATCH


def test_rays_before_a_missing_shell_are_good(tmp_path: Path) -> None:
    """Those that hit a part which is so large that it reaches out to the layer before it."""
    status = channels(scene(four_shells(tmp_path, 3, radius=18.0)))["status.code"]
    assert set(status.ravel()) == {Status.GOOD, Status.MISSED}


@pytest.mark.parametrize("left_out", [(), (1,), (4,), (1, 2), (3, 4)])
def test_shells_that_lead_from_layer_to_layer_are_not_warned_of(
    tmp_path: Path, left_out: tuple[int, ...]
) -> None:
    """Which layers there would be outside and inside of them, a scene does not tell."""
    loaded = scene(four_shells(tmp_path, *left_out))
    mi.render(loaded)
    assert set(channels(loaded)["status.code"].ravel()) == {Status.GOOD, Status.MISSED}


def test_other_media_and_shells_without_a_step_leave_no_gap(tmp_path: Path) -> None:
    """A glass plate leads from the ambient air; three shells of one index each bend nothing."""
    content = four_shells(tmp_path)
    plate = trimesh.creation.box((20.0, 2.0, 20.0))
    plate.apply_translation((0.0, -50.0, 0.0))
    glass = shell(tmp_path, "plate", plate, INDICES[0], 1.5)
    assert SceneTables(scene({**content, "plate": glass})).missing_steps == []
    for number, index in enumerate(INDICES[:4], start=1):
        bsdf = content[f"shell_{number}"]["bsdf"]
        bsdf["ext_ior"] = bsdf["int_ior"] = index
    assert SceneTables(scene(content)).missing_steps == []


def test_a_shell_without_triangles_is_refused(shapes: dict[str, Any]) -> None:
    properties = mi.Properties()
    bsdf = {"type": "iso_shell", "ext_ior": 1.0003, "int_ior": 1.0002}
    properties["mesh_bsdf"] = mi.load_dict(bsdf)
    shapes["shell_4"] = mi.Mesh("shell_4", 0, 0, properties, has_vertex_normals=True)
    scene = mi.load_dict({"type": "scene", "sensor": camera(), **shapes}, optimize=False)
    with pytest.raises(InputError, match="Shell 'shell_4' has no triangles"):
        SceneTables(scene)
