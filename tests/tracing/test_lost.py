"""Rays whose end is not known are never passed over in silence, and one choice serves all."""

from pathlib import Path
from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from attrs import evolve

from iriftrace.camera.pose import look_at
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.image.aov_image import Status
from iriftrace.image.ray_statistics import RayCounts
from iriftrace.measuring.two_devices.correct import correct
from iriftrace.measuring.two_devices.correction_status import CorrectionStatus
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.measuring.two_devices.scan import ScanStatus
from iriftrace.scenes import folder_of
from iriftrace.scenes.analytic import slab
from iriftrace.sweep.warned import FLAGS
from iriftrace.tracing import engine, render
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.lost import warn_of_lost_points, warn_of_lost_rays
from iriftrace.tracing.rays import trace_rays
from iriftrace.tracing.scene import Scene
from iriftrace.tracing.write import write_scene
from validation.inputs.cameras import camera_at
from validation.oracles.exact_layers import RoundAir

pytestmark = pytest.mark.usefixtures("variant")

BUNDLED = folder_of("cylinder") / "scene.xml"
ABOVE = [
    camera_at((x, 1.0, 250.0), sensor_mm=(6.7, 5.6), resolution=(122, 102)) for x in (-40.0, 40.0)
]
SIDE = [
    evolve(camera, matrix=look_at((x, -230.0, 0.0), (0.0, 0.0, 0.0)))
    for camera, x in zip(ABOVE, (-40.0, 40.0), strict=True)
]


def counts(hit: int, mismatch: int, gave_up: int) -> RayCounts:
    others = ("missed", "out_of_focus", "refracted_missed", "only_refracted", "blocked")
    found = {"good": hit - mismatch - gave_up, "index_mismatch": mismatch, "gave_up": gave_up}
    return RayCounts(hit=hit, **dict.fromkeys(others, 0), **found)


def test_a_picture_is_warned_of_from_half_a_per_cent_of_its_hits() -> None:
    warn_of_lost_rays(counts(1000, 3, 2))
    with pytest.warns(
        IriftraceWarning, match=r"6 of 1,000 hits \(0.6%\).*3 with inconsistent.*3 lost"
    ):
        warn_of_lost_rays(counts(1000, 3, 3))
    warn_of_lost_points(5, 1000, "are left out")
    with pytest.warns(IriftraceWarning, match=r"6 of 1,000 points \(0.6%\) are left out"):
        warn_of_lost_points(6, 1000, "are left out")


@pytest.fixture
def giving_up() -> Scene:
    """Rays may cross three shells, which is too few for those that hit the cylinder."""
    scene = load_scene(BUNDLED, engine="shells")
    scene.compiled.integrator.max_crossings = 3
    return scene


def test_every_command_says_so(giving_up: Scene) -> None:
    with pytest.warns(IriftraceWarning, match="lost on the way, status 6"):
        rendering = render.render_scene(giving_up, camera=SIDE[0], empty=True)
    assert rendering.metrics.rays.lost_fraction > 0.9
    with (
        pytest.warns(IriftraceWarning, match="points .* are left out"),
        pytest.raises(InputError, match="no point of the part in common"),
    ):
        measure(giving_up, *SIDE, system="stereo")
    cloud = giving_up.part.vertices[giving_up.part.vertices[:, 1] < -5.0]
    with pytest.raises(InputError, match=r".* have rays that were lost on the way"):
        correct(cloud, giving_up, *SIDE, system="stereo")
    assert "rays_lost" in {flag.name for flag in FLAGS}


def test_an_impossible_deflection_is_no_good_ray_even_beside_the_part() -> None:
    """Twice the arc cosine of the smallest over the largest index along the ray is the most."""
    from iriftrace.plugins.kernels.bundle import is_lost
    from iriftrace.plugins.kernels.queries import ESCAPED

    contrast = 2e-5
    most = 2 * np.arccos(1 - contrast)
    angle = mi.Float64([0.0, 0.99 * most, 1.01 * most])
    ends = SimpleNamespace(
        outcome=dr.full(mi.UInt32, ESCAPED, 3),
        direction=mi.Vector3d(dr.sin(angle), 0, dr.cos(angle)),
        contrast=dr.full(mi.Float, contrast, 3),
    )
    assert np.array(is_lost(mi.Vector3d(0, 0, 1), ends)).tolist() == [False, False, True]


@pytest.mark.parametrize("kind", ["shells", "cells"])
def test_rays_past_the_part_are_bent_far_less_than_the_bound(kind: str) -> None:
    scene = load_scene(BUNDLED, engine=kind)
    origin, direction = (np.tile(v, (2000, 1)) for v in ((0.0, -300.0, 0.0), (0.0, 1.0, 0.0)))
    origin = origin + np.random.default_rng(0).uniform((-80, 0, 14), (80, 0, 30), (2000, 3))
    hits = trace_rays(scene, origin, direction)
    assert (hits.status == Status.MISSED).all()
    turned = np.linalg.norm(hits.direction - direction, axis=1)
    assert 2e-5 < turned.max() < 4e-2


def test_python_and_commands_choose_alike() -> None:
    """Down through the plume shells are too coarse: a picture, a measurement, a correction."""
    scene = load_scene(BUNDLED)
    with pytest.warns(IriftraceWarning, match="the field data were traced instead"):
        rendering = render.render_scene(scene, camera=ABOVE[0])
    assert rendering.image.header["engine"] == "cells"
    with pytest.warns(IriftraceWarning, match="the field data were traced instead"):
        scan = measure(scene, *ABOVE, system="stereo")
    with pytest.warns(IriftraceWarning, match="the field data were traced instead"):
        found = correct(scan.points, scene, *ABOVE, system="stereo")
    assert scan.provenance["engine"] == found.provenance["engine"] == "cells"
    good = found.status == CorrectionStatus.CORRECTED
    assert good.mean() > 0.99
    left = np.linalg.norm(found.points[good] - scan.true[good], axis=1)
    assert np.quantile(left, 0.99) < 2e-5
    assert (scan.status == ScanStatus.LOST).sum() == 0


def test_a_field_that_loses_rays_does_not_take_over(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = load_scene(BUNDLED)
    monkeypatch.setattr(engine, "_lost_fraction", lambda *_: 0.1)
    with pytest.warns(IriftraceWarning, match="the field loses 10.0% of its rays"):
        assert engine.choose(scene, ABOVE[0]).scene is scene


def test_rays_that_meet_no_shell_in_hot_air_are_known(tmp_path: Path) -> None:
    """Along a wall, parallel to its layers: no shell is met, so none bends the ray."""
    part, shells = slab(13, air=RoundAir(), size_mm=400.0)
    camera = evolve(ABOVE[0], matrix=look_at((0.0, -200.0, 200.0), (0.0, 0.0, 0.0)))
    xml = write_scene(tmp_path, part, shells, camera, paraview=False)
    scene = load_scene(xml)
    prepared = scene.compiled.integrator.prepare(scene.compiled.mitsuba_scene)
    top = max(shell.vertices[:, 2].max() for shell in shells.shells)
    low = min(shell.vertices[:, 2].min() for shell in shells.shells)
    heights = np.array([low + 0.3, 0.5 * (low + top), top + 1.0])
    count = len(heights)
    mask = prepared.between_shells(
        mi.Point3d(-500.0, 0.0, mi.Float64(heights)),
        mi.Vector3d(1.0, 0.0, 0.0) + mi.Vector3d(mi.Float64(np.zeros(count))),
        mi.Float64(np.full(count, np.inf)),
        mi.Bool([True] * count),
    )
    assert np.array(mask).tolist() == [True, True, False]
