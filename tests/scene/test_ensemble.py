"""Mean and scatter over several fields, against NumPy's over pictures of each field alone."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
import pyvista as pv
import xarray as xr
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.air.refractivity import Air
from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.camera.pose_set import PoseSet
from iriftrace.cli import main
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.image.aov_image import (
    CHANNELS,
    MEMBERS_CHANNEL,
    SCATTER_CHANNELS,
    AovImage,
    Status,
    read_exr,
    write_exr,
)
from iriftrace.image.ray_statistics import Statistics, ensemble_metrics
from iriftrace.part.part import save_part
from iriftrace.scene import loaded as loaded_members
from iriftrace.scene.ensemble import read_members
from iriftrace.scene.load import load_scene
from iriftrace.scene.member_weights import MemberWeights
from iriftrace.scene.write import MemberAir, write_ensemble_scene
from iriftrace.scenes.analytic import slab, slab_heights
from iriftrace.sweep.sweep import run_sweep
from iriftrace.trace.pose_image import EnsembleStatistics
from iriftrace.trace.rays import trace_rays
from iriftrace.trace.render import render_scene
from validation.inputs import hot_block
from validation.inputs.shell_fields import scaled
from validation.oracles.aov_by_hand import make_image, plate

SHARES = np.array((-0.09, -0.07, -0.04, -0.01, 0.0, 0.02, 0.03, 0.05, 0.08, 0.11))
"""How much more the index differs from ambient in each of ten members than in the undisturbed."""

# Statistics of images made by hand -------------------------------------------------------------

CAMERA = Camera(
    focal_length_mm=10.0,
    sensor_mm=(6.0, 5.0),
    resolution=(24, 20),
    matrix=look_at((0.0, -100.0, 0.0), (0.0, 0.0, 0.0)),
)
PLATE = plate((20.0, 0, 0), (0, 0, 18.0), (0, 0, 0))


def images(count: int, lost: float = 0.0) -> list[AovImage]:
    """Images of a plate with random displacements, and a share of the rays lost in each."""
    random = np.random.default_rng(7)
    made = []
    for _ in range(count):
        status = np.where(random.random((20, 24)) < lost, Status.REFRACTED_MISSED, Status.GOOD)
        good = (status == Status.GOOD)[..., None]
        made.append(
            make_image(
                CAMERA,
                PLATE,
                displacement=good * random.normal(3e-3, 1e-3, (20, 24, 3)),
                shift=good * random.normal(0.1, 0.02, (20, 24, 2)),
                status=status,
            )
        )
    return made


@pytest.mark.parametrize("weights", [(1.0,) * 3, (0.5, 0.3, 0.2), (0.7, 0.3, 0.0)])
def test_weights_are_those_of_numpy(weights: tuple[float, ...]) -> None:
    """Against NumPy's covariance with weights (``aweights``), and the largest displacement."""
    members = images(3)
    statistics = EnsembleStatistics()
    for image, weight in zip(members, weights, strict=True):
        statistics.add(image, weight)
    found = statistics.image({})
    seen = members[0].channels["part.face"] > 0
    values = np.stack([image.channels["displacement.X"][seen].astype(float) for image in members])
    mean = np.average(values, axis=0, weights=weights)
    assert_allclose(found.channels["displacement.X"][seen], mean, rtol=1e-6)
    deviation = [np.sqrt(np.cov(column, aweights=weights)) for column in values.T]
    assert_allclose(found.channels["displacement.std.X"][seen], deviation, rtol=1e-5)
    assert_allclose(MemberWeights(weights).scatter(values), deviation, rtol=1e-9)
    norms = np.stack([image.channels["displacement.norm"][seen] for image in members])
    assert_array_equal(found.channels["ensemble.worst"][seen], norms.argmax(axis=0) + 1)
    assert_array_equal(found.channels["displacement.worst.norm"][seen], norms.max(axis=0))


def test_weights_that_are_none_are_refused() -> None:
    for weights in ((-0.1, 1.1), (0.0, 0.0), (1.0, np.nan)):
        with pytest.raises(InputError, match="weights"):
            MemberWeights(weights)


def test_mean_and_deviation_are_those_of_numpy() -> None:
    """Pixel by pixel, over the members in which the ray counts; the deviation is a sample's."""
    members = images(6, lost=0.4)
    statistics = EnsembleStatistics()
    for image in members:
        statistics.add(image)
    found = statistics.image({})
    good = np.stack([image.status == Status.GOOD for image in members])
    counted = good.sum(axis=0)
    seen = members[0].channels["part.face"] > 0
    assert_array_equal(found.channels[MEMBERS_CHANNEL], np.where(seen, counted, 0))
    assert set(np.unique(counted[seen])) >= {1, 2, 6}
    for name in ("displacement.X", "displacement.Y", "displacement.Z", "shift.px.X", "shift.px.Y"):
        values = np.ma.array([image.channels[name].astype(float) for image in members], mask=~good)
        mean = values.mean(axis=0).filled(0.0)
        assert_allclose(found.channels[name], np.where(seen, mean, 0.0), rtol=1e-6, atol=1e-12)
        deviation = np.ma.where(counted > 1, values.std(axis=0, ddof=1), 0.0).filled(0.0)
        quantity, axis = name.rsplit(".", 1)
        expected = np.where(seen, deviation, 0.0)
        assert_allclose(found.channels[f"{quantity}.std.{axis}"], expected, rtol=1e-5, atol=1e-12)
    axes = [found.channels[f"displacement.std.{axis}"] for axis in "XYZ"]
    total = np.sqrt(sum(a.astype(float) ** 2 for a in axes))
    assert_allclose(found.channels["displacement.std.norm"], total, rtol=1e-6)


def test_a_pixel_is_good_if_it_is_in_every_member() -> None:
    members = images(4, lost=0.3)
    statistics = EnsembleStatistics()
    for image in members:
        statistics.add(image)
    status = statistics.image({}).status
    states = np.stack([image.status for image in members])
    assert_array_equal(status == Status.GOOD, (states == Status.GOOD).all(axis=0))
    partly = (states != Status.GOOD).any(axis=0) & (states[0] != Status.MISSED)
    assert (status[partly] == Status.REFRACTED_MISSED).all()


def test_equal_members_scatter_not_at_all() -> None:
    statistics = EnsembleStatistics()
    (image,) = images(1)
    for _ in range(3):
        statistics.add(image)
    found = statistics.image({})
    for name in (name for name in SCATTER_CHANNELS if ".std." in name):
        assert_array_equal(found.channels[name], 0.0)
    norm = image.channels["displacement.norm"]
    assert_allclose(found.channels["displacement.norm"], norm, rtol=1e-6)


def test_other_parts_are_refused() -> None:
    statistics = EnsembleStatistics()
    statistics.add(images(1)[0])
    other = plate((20.0, 0, 0), (0, 0, 18.0), (0, 0, 0), cells=3)
    with pytest.raises(InputError, match="different parts"):
        statistics.add(make_image(CAMERA, other))


def test_channels_survive_the_file(tmp_path: Path) -> None:
    statistics = EnsembleStatistics()
    for image in images(3):
        statistics.add(image)
    header = {**images(1)[0].header, "ensemble": {"count": 3}}
    written = statistics.image(header)
    write_exr(tmp_path / "a.exr", written)
    found = read_exr(tmp_path / "a.exr")
    assert set(found.channels) == {*CHANNELS, *SCATTER_CHANNELS}
    for name in found.channels:
        assert_array_equal(found.channels[name], written.channels[name])
    assert found.vector("displacement.std").shape == (20, 24, 3)


def test_metrics_tell_bias_from_scatter() -> None:
    members = images(5)
    statistics = EnsembleStatistics()
    for image in members:
        statistics.add(image)
    found = statistics.image({"ensemble": {"count": 5}})
    pixels = np.flatnonzero(found.channels["part.face"])
    metrics = ensemble_metrics(found, pixels, pixels)
    worst = np.max([image.channels["displacement.norm"].ravel()[pixels] for image in members], 0)
    assert metrics.worst_mm.p95 == pytest.approx(np.percentile(worst, 95), rel=1e-6)
    assert metrics.worst_member in range(1, 6)
    assert metrics.members == metrics.rays_in_all // len(pixels) * 5
    # Three independent components of 1 um each.
    assert metrics.scatter_mm.rms == pytest.approx(np.sqrt(3) * 1e-3, rel=0.05)
    few = ensemble_metrics(found, pixels[:99], pixels)
    assert few.scatter_mm == Statistics()


# Scenes ----------------------------------------------------------------------------------------


SLANTED = Camera(
    focal_length_mm=10.0,
    sensor_mm=(6.0, 5.0),
    resolution=(30, 24),
    matrix=look_at((60.0, -40.0, 90.0), (0.0, 0.0, 0.0)),
)


@pytest.fixture(scope="module")
def ten(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A slab of hot air in ten states, each a linear perturbation of the same one."""
    part, stack = slab(5)
    folder = tmp_path_factory.mktemp("ten")
    airs = (MemberAir(f"share {share}", None, scaled(stack, share)) for share in SHARES)
    return write_ensemble_scene(folder, part, airs, SLANTED, paraview=False)[0]


@pytest.mark.usefixtures("variant")
def test_shells_and_parts_of_others_are_noticed(ten: Path, tmp_path: Path) -> None:
    """In the member that is traced; all know the part that stands beside the scene."""
    scene = shutil.copytree(ten.parent, tmp_path / "copy") / ten.name
    shells = [scene.parent / "members" / number / "shells" for number in "23"]
    shutil.copy(shells[0] / "shell_02.ply", shells[0] / "shell_03.ply")
    with pytest.warns(IriftraceWarning, match=r"2/shells/shell_03\.ply is not among the shells"):
        assert load_scene(scene, {"member": 2}).index_rule.startswith("edited: 1 of 5")
    save_part(slab(5)[0].transformed(np.diag((2.0, 2.0, 1.0, 1.0))), scene.parent / "part.ply")
    with pytest.warns(IriftraceWarning, match=r"part\.ply is not the part that the scene"):
        load_scene(scene, {"member": 3})


def slab_offsets(heights: np.ndarray, layers: np.ndarray, sine: np.ndarray) -> np.ndarray:
    """How much farther rays get across layers than straight ones, (n,) array, mm.

    n sin(theta) is the same in every layer, whose thickness is that between two shells.
    """
    thickness = -np.diff(heights, append=0.0)
    invariant = (1.0 + layers[0]) * sine[:, None]
    inner = invariant / (1.0 + layers[1:])
    return np.sum(thickness * (inner / np.sqrt(1 - inner**2)), axis=1) - thickness.sum() * (
        sine / np.sqrt(1 - sine**2)
    )


@pytest.mark.filterwarnings("ignore:Hits of this view")
@pytest.mark.usefixtures("variant")
def test_mean_and_scatter_agree_with_the_closed_form(ten: Path) -> None:
    """Each pixel against Snell's law in plane layers, and against the linear formula.

    To first order the displacement is proportional to 1 + share. The quadratic term is of the
    relative size (n - 1) tan^2(theta) < 2.2e-4 x 4, here below 1e-3 of share. The tracer is right
    to 1e-9 mm or so, displacements are 1e-3 to 1e-2 mm: 1e-6 of them.
    """
    image = render_scene(load_scene(ten, {"bending": "shells"})).image
    good = image.status == Status.GOOD
    assert good.sum() > 300
    assert (image.channels[MEMBERS_CHANNEL][good] == len(SHARES)).all()
    hits = image.vector("straight", good)
    away = hits - SLANTED.origin
    sine = np.hypot(away[:, 0], away[:, 1]) / np.linalg.norm(away, axis=1)
    # Only rays that meet the plate's top, below all of the layers.
    top = (np.abs(hits[:, 2]) < 1e-6) & (sine < 0.9)
    assert top.sum() > 200
    stack = slab(5)[1]
    air = Air()
    layers = np.array([stack.shells[0].ext, *(s.int_ for s in stack.shells)])
    heights = slab_heights(np.array([s.refractivity for s in stack.shells]), air)
    members = np.stack(
        [
            slab_offsets(heights, layers[0] + (1 + share) * (layers - layers[0]), sine[top])
            for share in SHARES
        ]
    )
    mean = image.channels["displacement.norm"][good][top]
    scatter = image.channels["displacement.std.norm"][good][top]
    assert_allclose(mean, members.mean(axis=0), rtol=1e-5, atol=2e-9)
    assert_allclose(scatter, members.std(axis=0, ddof=1), rtol=1e-4, atol=2e-9)

    undisturbed = slab_offsets(heights, layers, sine[top])
    assert_allclose(mean, (1 + SHARES.mean()) * undisturbed, rtol=1e-3)
    assert_allclose(scatter, SHARES.std(ddof=1) * undisturbed, rtol=2e-3)


@pytest.mark.usefixtures("variant")
def test_one_member_alone_is_an_ordinary_scene(ten: Path) -> None:
    """Also for plain Mitsuba, where the first one is the default."""
    alone = load_scene(ten, {"member": 10})
    assert alone.ensemble is None
    image = render_scene(alone).image
    assert set(image.channels) == set(CHANNELS)
    assert image.header["assumptions"]["field_member"] == "10: share 0.11"
    everything = load_scene(ten)
    assert everything.ensemble is not None
    scenes = list(everything.ensemble.scenes())
    assert len(scenes) == 10
    assert scenes[9].integrator.prepare(scenes[9].mitsuba_scene).tables.index_pairs == (
        alone.integrator.prepare(alone.mitsuba_scene).tables.index_pairs
    )
    shapes = mi.load_file(str(ten), optimize=False).shapes()
    assert [shape.id() for shape in shapes] == ["part", *(f"shell_{k:02d}" for k in range(1, 6))]


@pytest.mark.usefixtures("variant")
def test_straight_rays_are_traced_once(ten: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from iriftrace.plugins.kernels import bundle

    calls = []
    original = bundle.straight_hits
    monkeypatch.setattr(
        bundle, "straight_hits", lambda *a, **k: calls.append(1) or original(*a, **k)
    )
    render_scene(ten)
    assert len(calls) == 1


@pytest.mark.usefixtures("variant")
def test_members_that_do_not_fit_are_loaded_again(
    ten: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The result does not depend on how many stay in memory."""
    kept = render_scene(ten)
    monkeypatch.setattr(loaded_members, "KEPT_TRIANGLES", 25)
    scene = load_scene(ten)
    for _ in range(2):
        again = render_scene(scene)
        for name in kept.image.channels:
            assert_array_equal(again.image.channels[name], kept.image.channels[name])
    assert scene.ensemble is not None
    assert len(scene.ensemble._kept) == 2


@pytest.mark.usefixtures("variant")
def test_results_name_every_field(ten: Path) -> None:
    rendering = render_scene(ten)
    header = rendering.image.header
    assert header["ensemble"]["count"] == 10
    assert [m["label"] for m in header["ensemble"]["members"]] == [f"share {s}" for s in SHARES]
    metrics = rendering.metrics.as_dict()
    assumptions = metrics["assumptions"]
    assert assumptions["ensemble"].startswith("displacements are means over 10 fields")
    two = "index from share -0.09; index from share -0.07"
    assert assumptions["field_source"] == f"{two}; and 8 more"
    assert assumptions["field_origin"] == "synthetic: slab"
    assert metrics["ensemble"]["members"] == 10
    assert metrics["ensemble"]["bias_mm"] == metrics["displacement_mm"]
    assert metrics["ensemble"]["bias_px"] == metrics["shift_px"]
    assert metrics["shift_px"]["median"] > 0.0
    for region in metrics["regions"].values():
        assert region["ensemble"]["members"] == 10


@pytest.mark.usefixtures("variant")
def test_free_rays_want_one_member(ten: Path) -> None:
    with pytest.raises(InputError, match="ensemble of 10 fields"):
        trace_rays(ten, [[0, 0, 100.0]], [[0, 0, -1.0]])


Spoil = Callable[[Path], Any]


@pytest.mark.usefixtures("variant")
@pytest.mark.parametrize(
    ("spoil", "variables", "message"),
    [
        (lambda f: (f / "members" / "members.json").unlink(), {}, "missing or damaged"),
        (lambda f: (f / "members" / "members.json").write_text("{}"), {}, "missing or damaged"),
        (lambda f: (f / "members" / "2" / "shells.xml").unlink(), {}, "member 2"),
        (lambda f: None, {"member": 3}, 'no member "3"; give -D member=1 to member=2'),
        (lambda f: None, {"member": "./1"}, 'no member "./1"'),
    ],
)
def test_damaged_ensembles_are_refused(
    tmp_path: Path, spoil: Spoil, variables: dict[str, Any], message: str
) -> None:
    part, stack = slab(1)
    airs = [MemberAir("a", None, scaled(stack, share)) for share in (0.0, 0.1)]
    scene, _ = write_ensemble_scene(tmp_path, part, airs, SLANTED, paraview=False)
    spoil(tmp_path)
    with pytest.raises(InputError, match=message):
        load_scene(scene, variables)


def test_half_an_ensemble_leaves_the_old_one(tmp_path: Path) -> None:
    part, stack = slab(1)
    airs = [MemberAir("a", None, scaled(stack, share)) for share in (0.0, 0.1, 0.2)]
    scene, listed = write_ensemble_scene(tmp_path, part, airs, SLANTED, paraview=False)

    def stopping() -> Any:
        yield airs[0]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_ensemble_scene(tmp_path, part, stopping(), SLANTED, paraview=False)
    with pytest.raises(InputError, match="at least two"):
        write_ensemble_scene(tmp_path, part, airs[:1], SLANTED, paraview=False)
    assert read_members(scene) == listed
    assert sorted(path.name for path in tmp_path.iterdir()) == ["members", "part.ply", "scene.xml"]
    write_ensemble_scene(tmp_path, part, airs[:2], SLANTED, paraview=False)
    assert len(read_members(scene)) == 2
    assert not (tmp_path / "members" / "3").exists()


@pytest.mark.parametrize("name", ["air.vtu", "1/air.vtu", "notes.txt"])
def test_files_of_somebody_else_are_not_replaced(tmp_path: Path, name: str) -> None:
    """Fields in a folder that happens to be called members."""
    file = tmp_path / "members" / name
    file.parent.mkdir(parents=True)
    file.write_text("hours of simulation")
    if name == "notes.txt":
        (tmp_path / "members" / "members.json").write_text("{}")
    part, stack = slab(1)
    airs = [MemberAir("a", None, scaled(stack, share)) for share in (0.0, 0.1)]
    with pytest.raises(InputError, match="holds other files"):
        write_ensemble_scene(tmp_path, part, airs, SLANTED, paraview=False)
    assert file.read_text() == "hours of simulation"
    assert [path.name for path in tmp_path.iterdir()] == ["members"]


# Sweeps ----------------------------------------------------------------------------------------


def _poses() -> PoseSet:
    places = ((60.0, -40.0, 90.0), (-30.0, 50.0, 100.0))
    return PoseSet(matrices=np.stack([look_at(place, (0.0, 0.0, 0.0)) for place in places]))


@pytest.mark.usefixtures("variant")
def test_sweep_has_the_scatter_of_each_pose(ten: Path, tmp_path: Path) -> None:
    """As each pose rendered alone; an interrupted sweep goes on and ends the same."""
    scene = load_scene(ten)
    poses = _poses()

    def stop_after_one(done: int, total: int) -> None:
        if done == 1:
            raise KeyboardInterrupt

    path = tmp_path / "sweep.nc"
    with pytest.raises(KeyboardInterrupt):
        run_sweep(scene, poses, path, progress=stop_after_one)
    rendered: list[int] = []
    dataset = run_sweep(scene, poses, path, progress=lambda done, total: rendered.append(done))
    assert rendered == [1, 2]
    for number, matrix in enumerate(poses.matrices):
        rendering = render_scene(scene, camera=scene.camera.at(matrix))
        metrics = rendering.metrics.as_dict()
        part = dataset.sel(region="part").isel(pose=number)
        for key in ("mean", "median", "p95", "max", "rms"):
            assert float(part[f"scatter_{key}"]) == metrics["ensemble"]["scatter_mm"][key]
            assert float(part[f"displacement_{key}"]) == metrics["ensemble"]["bias_mm"][key]
        assert float(part["worst_p95"]) == metrics["ensemble"]["worst_mm"]["p95"]
        # The strongest air displaces most.
        assert int(part["worst_member"]) == metrics["ensemble"]["worst_member"] == 10
        assert int(part["ensemble_members"]) == 10
        assert int(part["rays_in_all"]) == metrics["ensemble"]["rays_in_all"]
    plain = xr.open_dataset(path, engine="h5netcdf")
    assert plain["scatter_mean"].attrs["cell_methods"] == "realization: standard_deviation"
    assert plain["scatter_mean"].attrs["units"] == "mm"
    assert plain["displacement_mean"].attrs["cell_methods"] == "realization: mean"
    assert "cell_methods" not in plain["coverage"].attrs
    assert len(json.loads(plain.attrs["scenes"])[0]["members"]) == 10
    plain.close()


@pytest.mark.usefixtures("variant")
def test_a_changed_member_is_another_sweep(tmp_path: Path) -> None:
    """The fingerprint covers every member's files, also those with nothing but indices."""
    part, stack = slab(1)

    def write(share: float) -> Any:
        airs = [MemberAir("a", None, scaled(stack, s)) for s in (0.0, share)]
        scene = load_scene(
            write_ensemble_scene(tmp_path / "s", part, airs, SLANTED, paraview=False)[0]
        )
        return run_sweep(scene, _poses(), tmp_path / "sweep.nc")

    write(0.1).close()
    write(0.1).close()
    with pytest.raises(InputError, match="another scene"):
        write(0.2)


# Commands --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def commanded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A user's folder with a series of three fields, a scene of it, a rendering and a sweep."""
    folder = tmp_path_factory.mktemp("series")
    grid = hot_block.air(12)
    excess = np.asarray(grid.point_data["T"]) - hot_block.AMBIENT
    refractivity = np.asarray(Air().refractivity(hot_block.AMBIENT + excess))
    ambient = Air().ambient_refractivity
    lines = []
    for number, share in enumerate((0.0, 0.05, 0.10)):
        state = pv.UnstructuredGrid()
        state.copy_structure(grid)
        state.point_data["refractivity"] = ambient + (1 + share) * (refractivity - ambient)
        state.save(folder / f"air_{number}.vtu")
        lines.append(f'<DataSet timestep="{number * 0.5}" file="air_{number}.vtu"/>')
    (folder / "air.pvd").write_text(
        '<VTKFile type="Collection" version="0.1"><Collection>'
        + "".join(lines)
        + "</Collection></VTKFile>"
    )
    hot_block.block().export(folder / "block.stl")
    words = ["scene", str(folder / "air.pvd"), str(folder / "block.stl"), "--layers=3"]
    scene = folder / "scene" / "scene.xml"
    assert main([*words, "-o", str(scene), *hot_block.CAMERA]) == 0
    assert main(["render", str(scene), "-o", str(folder / "all.exr")]) == 0
    return folder


@pytest.mark.usefixtures("variant")
def test_time_series_becomes_an_ensemble(commanded: Path) -> None:
    """Displacements are 0, 5 and 10 % larger: mean 1.05 of the first, scatter 0.05 of it."""
    members = read_members(commanded / "scene" / "scene.xml")
    assert [m.time for m in members] == [0.0, 0.5, 1.0]
    image = read_exr(commanded / "all.exr")
    scene = commanded / "scene" / "scene.xml"
    first = render_scene(load_scene(scene, {"member": 1})).image
    good = (image.status == Status.GOOD) & (first.channels["displacement.norm"] > 1e-5)
    alone = first.channels["displacement.norm"][good].astype(float)
    assert good.sum() > 1000
    # Contours of scaled numbers differ in the last digit, which moves a few vertices.
    ratio = image.channels["displacement.norm"][good] / alone
    assert np.median(ratio) == pytest.approx(1.05, rel=1e-3)
    ratio = image.channels["displacement.std.norm"][good] / alone
    assert np.median(ratio) == pytest.approx(0.05, rel=1e-2)
    assert (commanded / "all_scatter.png").is_file()
    metrics = json.loads((commanded / "all.json").read_text())
    assert metrics["ensemble"]["members"] == 3


@pytest.mark.usefixtures("variant")
def test_continuous_engine_takes_the_members_fields(commanded: Path) -> None:
    scene = load_scene(commanded / "scene" / "scene.xml", {"scale": 0.3}, engine="cells")
    image = render_scene(scene).image
    good = (image.status == Status.GOOD) & (image.channels["displacement.norm"] > 1e-5)
    ratio = (
        image.channels["displacement.std.norm"][good] / image.channels["displacement.norm"][good]
    )
    assert np.median(ratio) == pytest.approx(0.05 / 1.05, rel=1e-2)


@pytest.mark.usefixtures("variant")
def test_one_time_makes_an_ordinary_scene(commanded: Path, tmp_path: Path) -> None:
    words = ["scene", str(commanded / "air.pvd"), str(commanded / "block.stl"), "--layers=3"]
    scene = tmp_path / "scene.xml"
    assert main([*words, "-o", str(scene), "--time=0.5", *hot_block.CAMERA]) == 0
    assert load_scene(scene).ensemble is None


@pytest.mark.usefixtures("variant")
def test_a_span_of_times_makes_an_ensemble_of_these(
    commanded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["scene", str(commanded / "air.pvd"), str(commanded / "block.stl"), "--layers=2"]
    scene = tmp_path / "scene.xml"
    assert main([*words, "-o", str(scene), "--time=0.4:1", *hot_block.CAMERA]) == 0
    assert [m.time for m in read_members(scene)] == [0.5, 1.0]
    assert main([*words, "-o", str(scene), "--time=0.4:0.6", *hot_block.CAMERA]) == 0
    alone = load_scene(scene)
    assert alone.ensemble is None
    capsys.readouterr()
    assert main([*words, "-o", str(scene), "--time=2:3", *hot_block.CAMERA]) == 2
    assert "no time from 2 to 3; it has t = 0; t = 0.5; t = 1" in capsys.readouterr().err


@pytest.mark.usefixtures("variant")
def test_states_that_nobody_chose_are_averaged_with_a_word(
    commanded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["scene", str(commanded / "air.pvd"), str(commanded / "block.stl"), "--layers=2"]
    scene = str(tmp_path / "scene.xml")
    said = "All 3 states are averaged as an ensemble, t = 0 to t = 1; choose one with --time latest"
    assert main([*words, "-o", scene, *hot_block.CAMERA]) == 0
    assert said in " ".join(capsys.readouterr().err.split())
    assert main([*words, "-o", scene, "--time=all", *hot_block.CAMERA]) == 0
    assert "averaged" not in capsys.readouterr().err


@pytest.mark.usefixtures("variant")
def test_an_initial_state_without_hot_air_names_the_choice_of_a_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Time-dependent solutions begin with all air at ambient."""
    field, part = hot_block.save(tmp_path)
    still = hot_block.air()
    still.point_data["T"][:] = hot_block.AMBIENT
    still.save(tmp_path / "still.vtu")
    sets = [
        f'<DataSet timestep="{time}" file="{file}"/>'
        for time, file in ((0, "still.vtu"), (1, field.name))
    ]
    series = tmp_path / "air.pvd"
    series.write_text(
        f'<VTKFile type="Collection"><Collection>{"".join(sets)}</Collection></VTKFile>'
    )
    words = ["scene", str(series), str(part), "--layers=2", "-o", str(tmp_path / "s/scene.xml")]
    assert main([*words, *hot_block.CAMERA]) == 2
    error = " ".join(capsys.readouterr().err.split())
    assert "The member t = 0 cannot be used (choose states with --time, such as" in error
    assert main([*words, "--time=latest", *hot_block.CAMERA]) == 0


@pytest.mark.usefixtures("variant")
def test_several_files_become_an_ensemble(
    commanded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["scene", str(commanded / "air_0.vtu"), str(commanded / "block.stl"), "--layers=2"]
    more = [f"--member={commanded / f'air_{k}.vtu'}" for k in (1, 2)]
    scene = tmp_path / "scene.xml"
    assert main([*words, *more, "-o", str(scene), *hot_block.CAMERA]) == 0
    assert [m.label for m in read_members(scene)] == ["air_0.vtu", "air_1.vtu", "air_2.vtu"]
    capsys.readouterr()
    assert main([*words, more[0], more[0], "-o", str(scene), *hot_block.CAMERA]) == 2
    assert "is given twice" in capsys.readouterr().err
    other_way = f"--member={commanded / 'scene' / '..' / 'air_0.vtu'}"
    assert main([*words, other_way, "-o", str(scene), *hot_block.CAMERA]) == 2
    assert "is given twice" in capsys.readouterr().err


def test_members_elsewhere_or_without_hot_air_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The message names the member, and nothing of a scene is left behind."""
    grid = hot_block.air(4)
    grid.save(tmp_path / "air.vtu")
    far = grid.translate((500.0, 0.0, 0.0), inplace=False)
    far.save(tmp_path / "far.vtu")
    grid.point_data["T"] = np.full(grid.n_points, hot_block.AMBIENT)
    grid.save(tmp_path / "cold.vtu")
    hot_block.block().export(tmp_path / "block.stl")
    before = sorted(tmp_path.iterdir())
    words = ["scene", str(tmp_path / "air.vtu"), str(tmp_path / "block.stl"), "--layers=2"]
    for name, message in (("far", "does not reach the part"), ("cold", "no hot air")):
        member = f"--member={tmp_path / name}.vtu"
        assert (
            main([*words, member, f"--output={tmp_path / 'out' / 'scene.xml'}", *hot_block.CAMERA])
            == 2
        )
        said = capsys.readouterr().err
        assert message in said
        assert f"{name}.vtu" in said
    for span in ("a:b", "2:1", "1:"):
        assert main([*words, f"--time={span}", "-o", str(tmp_path / "x" / "scene.xml")]) == 2
        assert f'--time is "{span}"' in capsys.readouterr().err
    assert sorted(tmp_path.iterdir()) == before
