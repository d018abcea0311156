"""Scenes that `mi.traverse` changes between two renderings, and scenes that are not needed more."""

import gc
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import iriftrace
from iriftrace.core.errors import InputError
from validation.inputs.small_scenes import camera, nested_spheres

Change = Callable[[mi.SceneParameters], None]


def loaded(shapes: dict[str, Any], integrator: str = "first_hit") -> mi.Scene:
    content = {"type": "scene", "integrator": {"type": integrator}, "sensor": camera(), **shapes}
    return mi.load_dict(content, optimize=False)


def smaller_part(parameters: mi.SceneParameters) -> None:
    parameters["part.vertex_positions"] = parameters["part.vertex_positions"] * 0.5


def larger_shell(parameters: mi.SceneParameters) -> None:
    name = "shell_1.vertex_positions"
    parameters[name] = parameters[name] * 1.2


def turned_normals(parameters: mi.SceneParameters) -> None:
    """As if the ball's air were one that falls off along x."""
    normals = np.zeros((dr.width(parameters["shell_3.vertex_normals"]) // 3, 3), np.float32)
    normals[:, 0] = 1.0
    parameters["shell_3.vertex_normals"] = mi.Float(normals.ravel())


def blocked_view(parameters: mi.SceneParameters) -> None:
    parameters["wall.vertex_positions"] = parameters["wall.vertex_positions"] - mi.Float(
        np.tile(np.float32([100.0, 0.0, 0.0]), dr.width(parameters["wall.vertex_positions"]) // 3)
    )


@pytest.mark.parametrize("change", [smaller_part, larger_shell, turned_normals, blocked_view])
def test_a_changed_shape_is_traced_as_in_a_new_scene(
    shapes: dict[str, Any], change: Change
) -> None:
    """Its tables are made once for all poses, and were those of the shapes as they had been."""
    beside = mi.ScalarTransform4d().translate([100.0, -50.0, 0.0]).scale(6.0)
    shapes["wall"] = {"type": "cube", "to_world": beside, "bsdf": {"type": "diffuse"}}
    scene, fresh = loaded(shapes), loaded(shapes)
    before = np.array(mi.render(scene))
    for each in (scene, fresh):
        parameters = mi.traverse(each)
        change(parameters)
        parameters.update()
    after = np.array(mi.render(scene))
    assert not np.array_equal(after, before)
    np.testing.assert_array_equal(after, np.array(mi.render(fresh)))


def test_changed_indices_are_those_of_a_scene_built_with_them(
    shapes: dict[str, Any], tmp_path: Path
) -> None:
    """Of picture, rays and a scene in use: the bsdf had kept its first numbers."""
    scene = loaded(shapes)
    mi.render(scene)
    of_before = iriftrace.from_mitsuba(scene)
    changed = 1.00027200000001, 1.00023, 1.00022, 1.00018
    parameters = mi.traverse(scene)
    for k in (1, 2, 3):
        parameters[f"shell_{k}.bsdf.ext_ior"] = changed[k - 1]
        parameters[f"shell_{k}.bsdf.int_ior"] = changed[k]
    parameters.update()
    fresh = loaded({"part": shapes["part"], **nested_spheres(tmp_path, (20, 16, 13), changed)})
    np.testing.assert_array_equal(np.array(mi.render(scene)), np.array(mi.render(fresh)))
    with pytest.raises(InputError, match="changed since from_mitsuba"):
        of_before.compiled.mitsuba_scene  # noqa: B018
    ray = ([(1.0, -100.0, 2.0)], [(0.0, 1.0, 0.0)])
    one, other = (
        iriftrace.trace_rays(iriftrace.from_mitsuba(each), *ray) for each in (scene, fresh)
    )
    np.testing.assert_array_equal(one.refracted, other.refracted)


def test_an_unchanged_scene_keeps_its_tables_for_the_next_pose(shapes: dict[str, Any]) -> None:
    scene = loaded(shapes)
    mi.render(scene)
    tables = scene.integrator().prepare(scene)
    parameters = mi.traverse(scene)
    parameters["sensor.to_world"] = mi.ScalarTransform4d().look_at([0, 90, 9], [0, 0, 0], [0, 0, 1])
    parameters.update()
    mi.render(scene)
    assert scene.integrator().prepare(scene) is tables


def test_a_notebook_holds_no_more_than_the_scene_that_was_rendered_last(
    shapes: dict[str, Any],
) -> None:
    """Mitsuba's scene and its integrator's tables hold each other."""
    scene, other = loaded(shapes), loaded(shapes)
    mi.render(scene)
    tables = weakref.ref(scene.integrator().prepare(scene))
    del scene
    gc.collect()
    assert tables() is not None
    mi.render(other)
    gc.collect()
    assert tables() is None


def test_a_film_of_another_size_is_refused(shapes: dict[str, Any]) -> None:
    """The camera's pixels were made for the first, so the picture was a corner of it."""
    scene = loaded(shapes)
    parameters = mi.traverse(scene)
    parameters["sensor.film.size"] = [24, 20]
    parameters.update()
    with pytest.raises(RuntimeError) as caught:
        mi.render(scene)
    assert "24 x 20 px by mi.traverse, but the sensor is of 48 x 40" in str(caught.value.__cause__)


def test_what_was_made_of_a_changed_scene_is_refused(shapes: dict[str, Any]) -> None:
    scene = loaded(shapes)
    ray = ([(1.0, -100.0, 2.0)], [(0.0, 1.0, 0.0)])
    of_before = iriftrace.from_mitsuba(scene)
    hit = iriftrace.trace_rays(of_before, *ray).straight
    parameters = mi.traverse(scene)
    smaller_part(parameters)
    parameters.update()
    with pytest.raises(InputError, match=r"changed since from_mitsuba; call from_mitsuba again"):
        iriftrace.trace_rays(of_before, *ray)
    after = iriftrace.trace_rays(iriftrace.from_mitsuba(scene), *ray).straight
    assert np.linalg.norm(after) == pytest.approx(0.5 * np.linalg.norm(hit), rel=0.05)
