"""Derivatives of hits by reverse mode against central differences, through `mi.traverse`.

Of the sum of the displacements' components over rays that keep their faces, with a cosine above
0.2: what a derivative does not see is left out of the differences.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import iriftrace
from iriftrace.scenes import folder_of
from iriftrace.tracing.hits import Hits
from iriftrace.tracing.scene import Scene

pytestmark = pytest.mark.usefixtures("variant")

CYLINDER, HOT_PLATE = ("cylinder", "0.08"), ("hot_plate", "0.1")
SEEN_FROM_NEAR = ("cylinder_paper", "0.08")
"""In the other view one ray meets a shell so near an edge that differences are of both sides; with
a step of 1e-5 it has the derivative that is found."""
PLACES = [pytest.param(CYLINDER, id="cylinder")]
PLACES.append(pytest.param(HOT_PLATE, id="hot_plate", marks=pytest.mark.slow))
WEIGHTS = (0.3, -0.5, 0.8)

Set = Callable[[Any], None]
"""Give parameters the values that belong to a number (Float64); 0 for those of the file."""


@pytest.fixture(scope="module")
def load(variant: str) -> Callable[..., Scene]:
    """Scenes by name and scale, engine and bending, each loaded once."""

    @cache
    def loaded(name: str, scale: str, engine: str, bending: str = "layers") -> Scene:
        file = folder_of(name) / "scene.xml"
        return iriftrace.load_scene(file, {"scale": scale, "bending": bending}, engine=engine)

    return loaded


def faces(scene: Scene, hits: Hits) -> np.ndarray:
    """Faces of the straight and the refracted hit of each pixel, (n, 2); -1 for other rays."""
    width, height = scene.camera.resolution
    rows = np.full((width * height, 2), -1, dtype=np.int64)
    good = (np.array(hits.status) == 0) & (np.array(dr.detach(hits.incidence)) < np.arccos(0.2))
    both = np.stack((np.array(hits.face), np.array(hits.refracted_face)), axis=1)
    rows[np.array(hits.ray)[good]] = both[good]
    return rows


def along(hits: Hits) -> Any:
    """Weighted sum of the components of each ray's displacement (Float64, mm)."""
    return dr.dot(hits.displacement, mi.Vector3d(WEIGHTS))


def by_pixel(scene: Scene, hits: Hits) -> np.ndarray:
    """The same for each pixel, (n,); 0 where none is traced."""
    width, height = scene.camera.resolution
    values = np.zeros(width * height)
    values[np.array(hits.ray)] = np.array(along(hits))
    return values


def total(hits: Hits, weights: np.ndarray) -> Any:
    """Sum over the rays, times weights of their pixels, mm."""
    return dr.sum(dr.gather(mi.Float64, mi.Float64(weights), hits.ray) * along(hits))


def derivatives(
    scene: Scene, change: Set, step: float, *, steady: bool = False
) -> tuple[float, float]:
    """Derivative by the number that `change` takes, by reverse mode and by central differences.

    Each ray has the sign of its own difference as weight, so that nothing cancels. `steady` rays
    have the same difference with half the step: they keep the triangles of the shells as well.
    """
    known = faces(scene, iriftrace.hits(scene))
    kept, ends = known[:, 0] >= 0, []
    for factor in (1.0, -1.0, 0.5, -0.5)[: 4 if steady else 2]:
        change(mi.Float64(factor * step))
        hits = iriftrace.hits(scene)
        kept &= (faces(scene, hits) == known).all(axis=1)
        ends.append(by_pixel(scene, hits))
    difference = (ends[0] - ends[1]) / (2 * step)
    if steady:
        of_half = (ends[2] - ends[3]) / step
        kept &= np.abs(of_half - difference) < 1e-3 * np.abs(difference[kept]).mean()
    assert kept.sum() > 0.75 * (known[:, 0] >= 0).sum() > 500
    weights = np.where(kept, np.sign(difference), 0.0)
    number = mi.Float64(0.0)
    dr.enable_grad(number)
    change(number)
    dr.backward(total(iriftrace.hits(scene), weights))
    change(mi.Float64(0.0))
    return float(dr.grad(number)[0]), float(weights @ difference)


def assert_close(found: tuple[float, float], tolerance: float) -> None:
    reverse, difference = found
    assert abs(reverse - difference) < tolerance * abs(difference)


@pytest.fixture(params=PLACES)
def cells(request: pytest.FixtureRequest, load: Callable[..., Scene]) -> Scene:
    return load(*request.param, "cells")


def field_change(scene: Scene, tangent: np.ndarray) -> Set:
    """Temperatures that change by multiples of a tangent, K."""
    parameters = mi.traverse(scene.compiled.integrator)
    held = scene.compiled.integrator.air.cells
    start = mi.Float64(held.air.temperature(held.refractivity))

    def change(number: Any) -> None:
        parameters["field.temperature"] = start + number * mi.Float64(tangent)
        parameters.update()

    return change


def excess_of(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Points of a scene's field, (n, 3), mm, and how much hotter they are than the ambient, K."""
    held = scene.compiled.integrator.air.cells
    return held.points, held.air.temperature(held.refractivity) - held.air.temperature_k


def test_by_temperatures_along_a_smooth_direction(cells: Scene) -> None:
    points, excess = excess_of(cells)
    wave = np.cos(points @ (0.03, -0.05, 0.04)) * excess
    assert_close(derivatives(cells, field_change(cells, wave), 2e-3), 1e-4)


def test_by_noise_of_the_temperatures(cells: Scene) -> None:
    _, excess = excess_of(cells)
    noise = np.random.default_rng(1).standard_normal(len(excess)) * np.where(excess > 5, excess, 0)
    assert_close(derivatives(cells, field_change(cells, noise), 5e-4), 2e-3)


def test_by_the_contrast(cells: Scene) -> None:
    parameters = mi.traverse(cells.compiled.integrator)

    def change(number: Any) -> None:
        parameters["field.contrast"] = 1 + number
        parameters.update()

    assert_close(derivatives(cells, change, 1e-3), 1e-4)


def test_a_second_backward_pass_adds_the_same_again(cells: Scene) -> None:
    """The table is made of the parameter at each trace: nothing of a former pass is missing."""
    parameters = mi.traverse(cells.compiled.integrator)
    temperature = parameters["field.temperature"]
    dr.enable_grad(temperature)
    gradients = []
    for _ in range(2):
        hits = iriftrace.hits(cells)
        dr.backward(total(hits, np.where(faces(cells, hits)[:, 0] >= 0, 1.0, 0.0)))
        gradients.append(np.array(dr.grad(temperature)))
    dr.disable_grad(temperature)
    assert np.count_nonzero(gradients[0]) > 1000
    np.testing.assert_allclose(
        gradients[1], 2 * gradients[0], rtol=0, atol=1e-4 * np.abs(gradients[0]).max()
    )


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("bending", ["layers", "shells"])
def test_by_one_shells_index(
    place: tuple[str, str], bending: str, load: Callable[..., Scene]
) -> None:
    """The inner side alone, then all three, so that the shell's step stays."""
    scene = load(*place, "shells", bending)
    parameters = mi.traverse(scene.compiled.mitsuba_scene)
    names = [name for name in parameters.keys() if name.endswith("int_ior")]
    inner = names[1]
    three = [inner.replace("int_ior", name) for name in ("int_ior", "ext_ior", "iso_ior")]
    start = {name: mi.Float64(parameters[name]) for name in three}

    # Alone, the inner side changes the step of the index, 1e-5, which bends by more than its share.
    for changed, step in (((inner,), 3e-7), (tuple(three), 1e-6)):

        def change(number: Any, changed: tuple[str, ...] = changed) -> None:
            for name in changed:
                parameters[name] = start[name] + number
            parameters.update()

        assert_close(derivatives(scene, change, step), 1e-4)


def camera_changes(scene: Scene) -> dict[str, Set]:
    """Motions of the camera along and about the world's axes (mm, mrad), and its numbers."""
    parameters = mi.traverse(scene.compiled.mitsuba_scene)
    (key,) = (name for name in parameters.keys() if name.endswith("to_world"))
    sensor = key.removesuffix("to_world")
    start = mi.Transform4d(parameters[key].matrix)
    middle = scene.camera.matrix[:3, 3]
    changes: dict[str, Set] = {}
    for axis in range(3):
        unit = np.eye(3)[axis].tolist()

        def moved(number: Any, unit: list[float] = unit) -> None:
            way = mi.Transform4d().translate(mi.Vector3d(*unit) * number)
            parameters[key] = way @ start
            parameters.update()

        def turned(number: Any, unit: list[float] = unit) -> None:
            turn = mi.Transform4d().rotate(mi.Vector3d(*unit), dr.rad2deg(number * 1e-3))
            there = mi.Transform4d().translate(mi.Vector3d(middle.tolist()))
            parameters[key] = there @ turn @ there.inverse() @ start
            parameters.update()

        changes[f"move {axis}"], changes[f"turn {axis}"] = moved, turned
    for name, unit_step in (("focal_length", 1.0), ("principal_point_x", 100.0), ("k1", 1.0)):
        value = mi.Float64(parameters[sensor + name])

        def numbered(
            number: Any, name: str = name, value: Any = value, scale: float = unit_step
        ) -> None:
            parameters[sensor + name] = value + number * scale
            parameters.update()

        changes[name] = numbered
    return changes


KINDS = ("move", "turn", "focal_length", "principal_point", "k1")


@pytest.mark.parametrize(
    ("place", "engine", "kinds"),
    [
        (CYLINDER, "cells", ("move",)),
        *(
            pytest.param(place, engine, KINDS, marks=pytest.mark.slow)
            for place, engine in (
                (SEEN_FROM_NEAR, "shells"),
                (CYLINDER, "cells"),
                (HOT_PLATE, "shells"),
                (HOT_PLATE, "cells"),
            )
        ),
    ],
)
def test_by_the_camera(
    place: tuple[str, str], engine: str, kinds: tuple[str, ...], load: Callable[..., Scene]
) -> None:
    """Off by 1e-3 of the largest component at most."""
    scene = load(*place, engine)
    steady, changes = engine == "shells", camera_changes(scene)
    for kind in kinds:
        pairs = np.array(
            [
                derivatives(scene, change, 2e-3, steady=steady)
                for name, change in changes.items()
                if name.startswith(kind)
            ]
        )
        assert np.abs(pairs[:, 0] - pairs[:, 1]).max() < 1e-3 * np.abs(pairs[:, 1]).max()
