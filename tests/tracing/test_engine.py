"""The one choice of the engine: cells where lines of sight run along the layers of hot air."""

import json
from collections.abc import Callable
from functools import cache, partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve

from iriftrace.camera.pose import look_at
from iriftrace.camera.pose_set import PoseSet
from iriftrace.cli import main
from iriftrace.core.errors import IriftraceWarning
from iriftrace.io.exr import read_exr
from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part
from iriftrace.io.shells import load_shells
from iriftrace.medium.shells.stack import Shell, ShellStack
from iriftrace.scenes import folder_of
from iriftrace.sweep.reload import load_swept_scene
from iriftrace.sweep.sweep import run_sweep
from iriftrace.tracing.engine import EngineTest, choose
from iriftrace.tracing.hot_air import AirState, HotAir
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.rays import trace_rays
from iriftrace.tracing.render import render_scene
from iriftrace.tracing.scene import Scene
from iriftrace.tracing.write import write_scene
from validation.inputs.cameras import camera_at

pytestmark = pytest.mark.usefixtures("variant")

KEY = "engine_test"
SENSOR_MM = (6.7, 5.6)
seen_from = partial(camera_at, sensor_mm=SENSOR_MM, resolution=(153, 128))
FROM_THE_SIDE, FROM_ABOVE = (150.0, -100.0, 120.0), (1e-3, 0.0, 250.0)


def written(
    folder: Path, origin: tuple[float, float, float], shells: ShellStack | None = None
) -> Path:
    """Scene of the bundled cylinder, seen from a place."""
    bundled = folder_of("cylinder")
    stack = shells or load_shells(bundled / "shells")
    part = read_part(bundled / "part.ply")
    return write_scene(folder, part, stack, seen_from(origin), paraview=False)


@pytest.fixture(scope="module")
def bundled(
    tmp_path_factory: pytest.TempPathFactory,
) -> Callable[[tuple[float, float, float]], Scene]:
    """The bundled cylinder without its field, seen from a place."""
    return cache(lambda origin: load_scene(written(tmp_path_factory.mktemp("bundled"), origin)))


def every_second(stack: ShellStack) -> ShellStack:
    """The stack of the first, the third, ... shell, with layers that run from one to the next."""
    kept = stack.shells[::2]
    levels = [shell.refractivity for shell in kept]
    inner = [*(0.5 * (a + b) for a, b in pairwise(levels)), kept[-1].int_]
    outer = [kept[0].ext, *inner[:-1]]

    def put(k: int, shell: Shell) -> Shell:
        # Files count the gradient in the shell's own steps.
        share = (shell.ext - shell.int_) / (outer[k] - inner[k])
        derivatives = shell.derivatives * share
        return evolve(shell, layer=k + 1, ext=outer[k], int_=inner[k], derivatives=derivatives)

    return evolve(stack, shells=[put(k, shell) for k, shell in enumerate(kept)])


def found_in(scene: Scene) -> EngineTest | None:
    """Of the scene's own picture."""
    return choose(scene, None).test


def test_it_is_the_difference_to_a_scene_with_half_of_the_shells(bundled, tmp_path) -> None:
    """Written as a scene of its own and traced as any bundle of rays."""
    stack = load_shells(folder_of("cylinder") / "shells")
    half = load_scene(written(tmp_path, FROM_THE_SIDE, every_second(stack)))
    scenes = [bundled(FROM_THE_SIDE), half]
    assert [len(s.compiled.stated.shells) for s in scenes] == [13, 7]
    image = render_scene(scenes[0]).image
    good = image.status == 0
    assert 1000 < good.sum() < 5000
    rows, columns = np.nonzero(good)
    camera = scenes[0].camera
    size = np.array(camera.resolution)
    steps = (np.column_stack((columns, rows)) + 0.5 - size / 2) * np.array(SENSOR_MM) / size
    heading = np.column_stack((steps, np.full(len(steps), 10.0))) @ camera.matrix[:3, :3].T
    origins = np.tile(camera.matrix[:3, 3], (len(heading), 1))
    ends = [trace_rays(scene, origins, heading).refracted for scene in scenes]
    moved = np.linalg.norm(ends[1] - ends[0], axis=1)
    known = np.isfinite(moved)
    length = image.channels["displacement.norm"][good].astype(np.float64)[known]
    found = found_in(scenes[0])
    assert found is not None
    assert found.rays == known.sum()
    for share, quantile in ((found.median_share, 0.5), (found.p95_share, 0.95)):
        expected = np.quantile(moved[known], quantile) / np.quantile(length, quantile)
        assert share == pytest.approx(expected, rel=1e-2)


def test_straight_down_the_plume_it_warns_and_from_the_side_it_does_not(bundled) -> None:
    side = found_in(bundled(FROM_THE_SIDE))
    with pytest.warns(IriftraceWarning, match='engine="cells"') as said:
        above = found_in(bundled(FROM_ABOVE))
    assert said[0].message.argument == "engine"
    assert side.suffices
    assert side.p95_share < 0.02
    assert not above.suffices
    assert above.p95_share > 0.3


def test_a_sweep_keeps_it_of_each_pose_and_says_how_many(bundled, tmp_path: Path) -> None:
    """With another camera than the scene's own, and from a sample of the rays."""
    scene = bundled(FROM_THE_SIDE)
    matrices = np.stack([look_at(o, (0.0, 0.0, 0.0)) for o in (FROM_THE_SIDE, FROM_ABOVE)])
    away = look_at((0.0, -200.0, 0.0), (0.0, -400.0, 0.0))
    poses = PoseSet(np.concatenate((matrices, away[None])))
    with pytest.warns(IriftraceWarning, match=r"1 of 3 poses .*engine_test_p95"):
        dataset = run_sweep(scene, poses, tmp_path / "s.nc")
    side, above, nothing = dataset["engine_test_p95"].values
    whole = found_in(scene)
    assert side == pytest.approx(whole.p95_share, rel=1e-6)
    assert above > 0.3
    assert np.isnan(nothing)


def test_render_says_it_and_metrics_keeps_it(
    bundled, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    exr, xml = tmp_path / "out.exr", bundled(FROM_ABOVE).path
    assert main(["render", str(xml), "-o", str(exr), "--no-figures"]) == 0
    assert "every second shell" in " ".join("".join(capsys.readouterr()).split())
    before = json.loads(exr.with_suffix(".json").read_text())[KEY]
    assert before["suffices"] is False
    assert main(["metrics", str(exr)]) == 0
    assert json.loads(exr.with_suffix(".json").read_text())[KEY] == before


def test_nothing_is_said_where_shells_cannot_be_thinned_out(tmp_path: Path) -> None:
    stack = load_shells(folder_of("cylinder") / "shells")
    few = evolve(stack, shells=stack.shells[:4])
    scene = load_scene(written(tmp_path, FROM_ABOVE, few))
    assert found_in(scene) is None
    xml = folder_of("cylinder") / "scene.xml"
    continuous = load_scene(xml, {"scale": 0.1}, engine="cells")
    assert found_in(continuous) is None


@pytest.fixture(scope="module")
def with_field(
    tmp_path_factory: pytest.TempPathFactory,
) -> Callable[[tuple[float, float, float]], Path]:
    """Scenes of the bundled cylinder, seen from a place, with its field beside them."""
    field = read_field(folder_of("cylinder") / "field.vtu")
    part, air = read_part(folder_of("cylinder") / "part.ply"), AirState(field)

    @cache
    def write(origin: tuple[float, float, float]) -> Path:
        folder = tmp_path_factory.mktemp("with_field")
        return write_scene(folder, part, air, seen_from(origin), paraview=False)

    return write


@pytest.mark.parametrize(
    ("options", "engine", "said"),
    [
        ((), "cells", "the field data were traced instead"),
        (("--engine", "shells"), "shells", "(layers=20) (--engine)"),
        (("-D", "bending=shells"), "shells", "(layers=20) (--engine)"),
    ],
)
def test_the_field_is_traced_where_shells_are_too_few_and_nothing_else_is_asked_for(
    with_field: Callable[[tuple[float, float, float]], Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    options: tuple[str, ...],
    engine: str,
    said: str,
) -> None:
    """The change is said as a length, too: a share of next to nothing may be anything."""
    exr, xml = tmp_path / "out.exr", with_field(FROM_ABOVE)
    assert main(["render", str(xml), "-o", str(exr), "--no-figures", *options]) == 0
    printed = " ".join("".join(capsys.readouterr()).split())
    found = json.loads(exr.with_suffix(".json").read_text())
    p95 = found[KEY]["p95_mm"]
    assert said in printed
    assert f"change by {1e3 * p95:.3g} um" in printed
    image = read_exr(exr)
    assert image.header["engine"] == engine
    instead = engine == "cells"
    assert found[KEY]["through_cells"] == instead
    if options == ("--engine", "shells"):
        # Of the sample, and of all rays.
        p95_of_all = found["displacement_mm"]["p95"]
        assert p95 / found[KEY]["p95_share"] == pytest.approx(p95_of_all, rel=0.1)
    if instead:
        asked = render_scene(load_scene(xml, engine="cells")).image
        for name, plane in image.channels.items():
            np.testing.assert_array_equal(plane, asked.channels[name])


@pytest.mark.slow
def test_a_sweep_traces_the_field_where_shells_are_too_few(
    with_field: Callable[[tuple[float, float, float]], Path], tmp_path: Path
) -> None:
    scene = load_scene(with_field(FROM_THE_SIDE))
    poses = PoseSet(np.stack([look_at(o, (0.0, 0.0, 0.0)) for o in (FROM_THE_SIDE, FROM_ABOVE)]))
    with pytest.warns(IriftraceWarning, match=r"1 of 2 poses .*the field data were traced there"):
        dataset = run_sweep(scene, poses, tmp_path / "s.nc")
    assert dataset["through_cells"].values.tolist() == [0, 1]
    images = [load_swept_scene(dataset, k).render(poses.matrices[k]).image for k in (0, 1)]
    assert [image.header["engine"] for image in images] == ["shells", "cells"]


def test_rays_of_a_bundle_are_chosen_for_as_those_of_a_picture(
    with_field: Callable[[tuple[float, float, float]], Path],
) -> None:
    """Down the plume all get the field's numbers, even a few rays; insisting gives the shells'."""
    xml = with_field(FROM_ABOVE)
    scene = load_scene(xml)
    origins = np.tile(scene.camera.origin, (40, 1))
    towards = np.column_stack((np.linspace(-12, 12, 40), np.zeros(40), np.zeros(40))) - origins
    with pytest.warns(IriftraceWarning, match="the field data were traced instead"):
        found = trace_rays(scene, origins, towards)
    cells = trace_rays(load_scene(xml, engine="cells"), origins, towards)
    shells = trace_rays(load_scene(xml, engine="shells"), origins, towards)
    np.testing.assert_array_equal(found.refracted, cells.refracted)
    away = np.linalg.norm(shells.displacement - cells.displacement, axis=1)
    assert np.nanmax(away) > 0.05 * np.nanmax(np.linalg.norm(cells.displacement, axis=1))


@pytest.mark.slow
def test_an_ensemble_is_traced_alike_in_all_members(tmp_path: Path) -> None:
    """Cells of all members where the shells of one are too few."""
    field = read_field(folder_of("cylinder") / "field.vtu")
    part = read_part(folder_of("cylinder") / "part.ply")
    air = HotAir([field, field], layers=5)
    scene = Scene(part, air, seen_from(FROM_ABOVE))
    with pytest.warns(IriftraceWarning, match="the field data were traced instead"):
        found = render_scene(scene)
    assert found.image.header["engine"] == "cells"
    assert found.metrics.engine_test["through_cells"]
    alone = render_scene(evolve(scene, air=HotAir(field, layers=1), engine="cells")).image
    np.testing.assert_allclose(
        found.image.channels["displacement.norm"], alone.channels["displacement.norm"], atol=1e-7
    )
