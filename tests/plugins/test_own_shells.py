"""Shells that a user of Mitsuba makes: openings, lengths of their derivatives, and empty ones."""

from typing import Any

import mitsuba as mi
import numpy as np
import pytest
import trimesh

from iriftrace.core.errors import InputError
from iriftrace.plugins.kernels.tables import SceneTables, is_closed
from iriftrace.shells.hessian import HESSIAN_AXES
from validation.inputs.small_scenes import camera

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


def test_a_shell_without_triangles_is_refused(shapes: dict[str, Any]) -> None:
    properties = mi.Properties()
    bsdf = {"type": "iso_shell", "ext_ior": 1.0003, "int_ior": 1.0002}
    properties["mesh_bsdf"] = mi.load_dict(bsdf)
    shapes["shell_4"] = mi.Mesh("shell_4", 0, 0, properties, has_vertex_normals=True)
    scene = mi.load_dict({"type": "scene", "sensor": camera(), **shapes}, optimize=False)
    with pytest.raises(InputError, match="Shell 'shell_4' has no triangles"):
        SceneTables(scene)
