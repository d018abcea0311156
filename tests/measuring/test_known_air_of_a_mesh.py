"""Errors of both engines in air from formulas on meshes, and the exact rays behind them."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import trimesh
from attrs import evolve

from iriftrace.camera.camera import Camera
from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.flow.synthetic.field import synthetic_field, write_synthetic_field
from iriftrace.flow.synthetic.mesh import usual_mesh
from iriftrace.flow.synthetic.model import SyntheticAir, synthetic_air
from iriftrace.io.part_files import save_part
from iriftrace.measuring.uncertainty.air_groups import AirGroups, Scaled
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.measuring.uncertainty.known_air import (
    KnownAir,
    displacements,
    index_of,
    known_air,
)
from iriftrace.medium.index_field import IndexField
from iriftrace.scenes import folder_of
from iriftrace.tracing.hot_air import HotAir
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.rays import trace_rays
from iriftrace.tracing.scene import Scene
from validation.inputs.cameras import camera_at
from validation.inputs.parts import part_from
from validation.oracles.curved_rays import first_hits

RAYS = 150

pytestmark = [pytest.mark.usefixtures("variant"), pytest.mark.slow]


@pytest.fixture(scope="module")
def air() -> SyntheticAir:
    """Around a ball of 24 mm."""
    ball = part_from(trimesh.creation.icosphere(4, 12.0))
    return synthetic_air(ball, boundary_layer_mm=6.0)


def meshed(air: SyntheticAir, cell_mm: float) -> IndexField:
    size = usual_mesh(air, cell_mm=cell_mm, sides_mm=10.0, height_mm=15.0)
    return synthetic_field(air, size)


def from_the_side() -> Camera:
    return camera_at((0.0, -100.0, 10.0), resolution=(240, 200), sensor_mm=(3.6, 3.0))


def seen(air: SyntheticAir, field: IndexField) -> Scene:
    return Scene(air.part, HotAir(field, layers=5), from_the_side())


@pytest.fixture(scope="module")
def fine(air: SyntheticAir) -> KnownAir:
    field = meshed(air, 1.0)
    return known_air(seen(air, field), field, air.at, layers=13, rays=RAYS)


def of(found: KnownAir, engine: str, pixels: str = "inside") -> tuple[float, float]:
    (one,) = (e for e in found.errors if (e.engine, e.pixels) == (engine, pixels))
    return one.median, one.p95


def test_a_fine_mesh_costs_a_few_per_cent(fine: KnownAir) -> None:
    for engine in ("shells", "cells"):
        assert 0.0 < of(fine, engine)[0] < 0.035
        assert fine.numerics[engine] == of(fine, engine)[0]
    assert {one.rays for one in fine.errors if one.pixels == "inside"} == {RAYS}


def test_silhouettes_are_apart_and_move_by_more(fine: KnownAir) -> None:
    inside, edge = (
        next(e for e in fine.errors if e.pixels == pixels) for pixels in ("inside", "silhouettes")
    )
    assert 20 <= edge.rays <= RAYS // 4
    assert edge.displacement_median_mm > 3.0 * inside.displacement_median_mm


def test_a_coarse_mesh_costs_more(air: SyntheticAir, fine: KnownAir) -> None:
    field = meshed(air, 2.4)
    found = known_air(seen(air, field), field, air.at, rays=RAYS)
    for engine in ("shells", "cells"):
        assert of(found, engine)[0] > 2.0 * of(fine, engine)[0]


def test_few_shells_are_an_error_of_the_shells_only(air: SyntheticAir, fine: KnownAir) -> None:
    field = meshed(air, 1.0)
    found = known_air(seen(air, field), field, air.at, layers=3, rays=RAYS)
    assert of(found, "cells") == of(fine, "cells")
    edge = "silhouettes"
    assert of(found, "shells", edge)[1] > 2.0 * of(fine, "shells", edge)[1]


def test_a_formula_that_is_not_on_the_mesh_is_an_error_of_its_size(air: SyntheticAir) -> None:
    """The engines see a wall of 1373 K, the exact rays one of 600 K with 0.65 of its contrast."""
    field = meshed(air, 1.0)
    cooler = evolve(air, wall_k=600.0)
    calls = []

    def changed(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        calls.append(len(points))
        return (air if len(calls) == 1 else cooler).at(points)

    found = known_air(seen(air, field), field, changed, rays=RAYS)
    assert 0.4 < of(found, "cells")[0] < 1.2


def test_exact_rays_are_those_of_the_oracle(air: SyntheticAir) -> None:
    """Hits by Mitsuba and by brute force, in steps of 0.5 and 0.125 mm."""
    field = meshed(air, 2.4)
    scene = evolve(seen(air, field), engine="shells")
    bounds = np.reshape(field.grid.bounds, (3, 2)).T
    medium = index_of(air.at, field.air, bounds)
    places = np.random.default_rng(3).uniform((60, 50), (180, 150), (60, 2))
    origin, direction = scene.camera.rays(places)

    def hits(start: np.ndarray, heading: np.ndarray) -> np.ndarray:
        return np.linalg.norm(trace_rays(scene, start, heading).straight - start, axis=1)

    exact = displacements(partial(first_hits, air.part), medium, origin, direction, 40.0, 0.125)
    product = displacements(hits, medium, origin, direction, 40.0, 0.5)
    size = np.linalg.norm(exact, axis=1)
    assert np.isfinite(size).all()
    off = np.linalg.norm(product - exact, axis=1)
    assert np.median(off / size) < 1e-3
    assert np.quantile(off, 0.95) < 2e-3 * np.quantile(size, 0.95)


def test_index_outside_the_data_is_that_of_the_room(air: SyntheticAir) -> None:
    field = meshed(air, 2.4)
    at = index_of(air.at, field.air, np.array([[-20.0] * 3, [20.0] * 3]))
    refractivity, gradient = at(np.array([[0.0, 0.0, 13.0], [0.0, 0.0, 20.5]]))
    assert refractivity[1] == field.ambient_refractivity
    assert refractivity[0] < 0.5 * refractivity[1]
    assert (gradient[1] == 0.0).all()
    step = np.array([[0.0, 0.0, 13.0 + h] for h in (-1e-4, 1e-4)])
    slope = np.diff(at(step)[0])[0] / 2e-4
    assert gradient[0, 2] == pytest.approx(slope, rel=1e-4)


def test_a_camera_that_sees_nothing_is_refused(air: SyntheticAir) -> None:
    field = meshed(air, 2.4)
    away = evolve(seen(air, field), camera=camera_at((0.0, -100.0, 10.0), (0.0, -200.0, 0.0)))
    with pytest.raises(InputError) as error:
        known_air(away, field, air.at, rays=RAYS)
    assert error.value.code == "picture.no_hit"


def test_numerics_is_a_group_of_the_budget() -> None:
    scene = load_scene(folder_of("cylinder") / "scene.xml")
    groups = AirGroups.of(scene, Inputs.of("numerics 3.2 %"))
    assert groups.scaled["numerics"] == Scaled(0.032, "stated")
    assert groups.parts(2.0, None)["numerics"] == pytest.approx(0.064)


def test_command_writes_what_a_budget_states(
    air: SyntheticAir, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    field, part, check = tmp_path / "field.vtu", tmp_path / "part.ply", tmp_path / "check.json"
    save_part(air.part, part)
    size = usual_mesh(air, cell_mm=1.2, sides_mm=10.0, height_mm=15.0)
    written = write_synthetic_field(field, air, size)
    assert written.n_points > 0
    xml = tmp_path / "scene" / "scene.xml"
    seen(air, synthetic_field(air, size)).save(xml)
    words = ["field", "check", str(field), str(part), "-o", str(check), "--known", str(xml)]
    assert main([*words, "--layers", "9"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    known = json.loads(check.read_text())["known_air"]
    assert known["layers"] == 9
    for engine, name in (("shells", "9 shells"), ("cells", "cells")):
        u = known["numerics"][engine]
        assert f'"numerics {100 * u:.2g} %" ({name})' in text
        assert 0.0 < u < 0.2
    save_part(evolve(air.part, vertices=1.2 * air.part.vertices), part)
    assert main(words) == 2
