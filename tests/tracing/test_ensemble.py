"""Scenes of several fields: written, loaded, rendered and swept, against closed forms."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.camera.pose_set import PoseSet
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.image.aov_image import CHANNELS, MEMBERS_CHANNEL, Status
from iriftrace.io.part_files import save_part
from iriftrace.medium.air.refractivity import Air
from iriftrace.scenes.analytic import slab, slab_heights
from iriftrace.sweep.sweep import run_sweep
from iriftrace.tracing import pose_image
from iriftrace.tracing import scene as scenes_of_values
from iriftrace.tracing.ensemble import read_members
from iriftrace.tracing.hot_air import AirState, FieldMember
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.provenance import provenance
from iriftrace.tracing.rays import trace_rays
from iriftrace.tracing.render import render_scene
from iriftrace.tracing.write import write_ensemble_scene
from validation.inputs.cameras import camera_at
from validation.inputs.shell_fields import scaled

pytestmark = pytest.mark.usefixtures("variant")

SHARES = np.array((-0.09, -0.04, 0.0, 0.05, 0.11))
"""Relative change of the contrast in each of five members from the undisturbed one."""

SLANTED = camera_at((60.0, -40.0, 90.0), resolution=(30, 24))


def write_slab(folder: Path, airs: Any) -> tuple[Path, tuple[FieldMember, ...]]:
    """Write the scene of states of the slab's air."""
    return write_ensemble_scene(folder, slab(1)[0], airs, SLANTED)


def airs_of(*shares: float, layers: int = 1) -> list[AirState]:
    """States of the slab's air with so much more index."""
    return [AirState(None, f"share {s}", ready=scaled(slab(layers)[1], s)) for s in shares]


@pytest.fixture(scope="module")
def five(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A slab of hot air in five states, each a linear perturbation of the same one."""
    return write_slab(tmp_path_factory.mktemp("five"), airs_of(*SHARES, layers=5))[0]


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_slab(tmp_path_factory.mktemp("three"), airs_of(-0.1, 0.0, 0.2, layers=5))[0]


def test_shells_and_parts_of_others_are_noticed(five: Path, tmp_path: Path) -> None:
    """In the member that is traced; all know the part that stands beside the scene."""
    scene = shutil.copytree(five.parent, tmp_path / "copy") / five.name
    shells = [scene.parent / "members" / number / "shells" for number in "23"]
    shutil.copy(shells[0] / "shell_02.ply", shells[0] / "shell_03.ply")
    with pytest.warns(IriftraceWarning, match=r"2/shells/shell_03\.ply is not among the shells"):
        assert load_scene(scene, {"member": 2}).compiled.index_rule.startswith("edited: 1 of 5")
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
def test_mean_and_scatter_agree_with_the_closed_form(five: Path) -> None:
    """Each pixel against Snell's law in plane layers, and against the linear formula.

    To first order the displacement is proportional to 1 + share. The quadratic term is of the
    relative size (n - 1) tan^2(theta) < 2.2e-4 x 4, here below 1e-3 of share. The tracer is right
    to 1e-9 mm or so, displacements are 1e-3 to 1e-2 mm: 1e-6 of them.
    """
    image = render_scene(load_scene(five, {"bending": "shells"})).image
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


def test_one_member_alone_is_an_ordinary_scene(five: Path) -> None:
    """Also for plain Mitsuba, where the first one is the default."""
    alone = load_scene(five, {"member": 5})
    assert not alone.members
    image = render_scene(alone).image
    assert set(image.channels) == set(CHANNELS)
    assert image.header["assumptions"]["field_member"] == "5: share 0.11"
    everything = load_scene(five)
    assert everything.members
    scenes = list(everything.alone())
    assert len(scenes) == 5
    assert scenes[4].compiled.tables.index_pairs == (alone.compiled.tables.index_pairs)
    shapes = mi.load_file(str(five), optimize=False).shapes()
    assert [shape.id() for shape in shapes] == ["part", *(f"shell_{k:02d}" for k in range(1, 6))]


def test_the_provenance_of_a_picture_is_stated_once(
    five: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []
    monkeypatch.setattr(
        pose_image, "provenance", lambda *given: asked.append(given) or provenance(*given)
    )
    scene = load_scene(five)
    header = render_scene(scene).image.header
    assert len(asked) == 1
    stated = provenance(scene.ready, Camera.from_dict(header["camera"]))
    assert {key: header[key] for key in stated} == stated
    assert {"schema", "pose", "time_s", "counts", "full_resolution"} <= set(header)


def test_straight_rays_are_traced_once(five: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from iriftrace.plugins.kernels import bundle

    calls = []
    original = bundle.straight_hits
    monkeypatch.setattr(
        bundle, "straight_hits", lambda *a, **k: calls.append(1) or original(*a, **k)
    )
    render_scene(load_scene(five))
    assert len(calls) == 1


def test_members_that_do_not_fit_are_loaded_again(
    three: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The result does not depend on how many stay in memory."""
    rendered = render_scene(load_scene(three))
    monkeypatch.setattr(scenes_of_values, "KEPT_TRIANGLES", 25)
    scene = load_scene(three)
    for _ in range(2):
        again = render_scene(scene)
        for name, values in rendered.image.channels.items():
            assert_array_equal(again.image.channels[name], values)
    assert len(scene._held.members) == 2


def test_results_name_every_field(five: Path) -> None:
    rendered = render_scene(load_scene(five))
    header = rendered.image.header
    assert header["ensemble"]["count"] == 5
    assert [m["label"] for m in header["ensemble"]["members"]] == [f"share {s}" for s in SHARES]
    metrics = rendered.metrics.as_dict()
    assumptions = metrics["assumptions"]
    assert assumptions["ensemble"].startswith("displacements are means over 5 fields")
    two = "index from share -0.09; index from share -0.04"
    assert assumptions["field_source"] == f"{two}; and 3 more"
    assert assumptions["field_origin"] == "synthetic: slab"
    assert metrics["ensemble"]["members"] == 5
    assert metrics["ensemble"]["bias_mm"] == metrics["displacement_mm"]
    assert metrics["ensemble"]["bias_px"] == metrics["shift_px"]
    assert metrics["shift_px"]["median"] > 0.0
    for region in metrics["regions"].values():
        assert region["ensemble"]["members"] == 5


def test_free_rays_want_one_member(five: Path) -> None:
    with pytest.raises(InputError, match="ensemble of 5 fields"):
        trace_rays(load_scene(five), [[0, 0, 100.0]], [[0, 0, -1.0]])


Spoil = Callable[[Path], Any]


@pytest.mark.parametrize(
    ("spoil", "variables", "code"),
    [
        (lambda f: (f / "members" / "members.json").unlink(), {}, "file.damaged"),
        (lambda f: (f / "members" / "members.json").write_text("{}"), {}, "file.damaged"),
        (lambda f: (f / "members" / "2" / "shells.xml").unlink(), {}, "file.missing"),
        (lambda f: None, {"member": 3}, "scene.unknown_member"),
        (lambda f: None, {"member": "./1"}, "scene.unknown_member"),
    ],
)
def test_damaged_ensembles_are_refused(
    tmp_path: Path, spoil: Spoil, variables: dict[str, Any], code: str
) -> None:
    scene, _ = write_slab(tmp_path, airs_of(0.0, 0.1))
    spoil(tmp_path)
    with pytest.raises(InputError) as error:
        load_scene(scene, variables)
    assert error.value.code == code


def test_half_an_ensemble_leaves_the_old_one(tmp_path: Path) -> None:
    airs = airs_of(0.0, 0.1, 0.2)
    scene, listed = write_slab(tmp_path, airs)

    def stopping() -> Any:
        yield airs[0]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_slab(tmp_path, stopping())
    with pytest.raises(InputError, match="at least two"):
        write_slab(tmp_path, airs[:1])
    assert read_members(scene) == listed
    assert sorted(path.name for path in tmp_path.iterdir()) == ["members", "part.ply", "scene.xml"]
    write_slab(tmp_path, airs[:2])
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
    with pytest.raises(InputError, match="holds other files"):
        write_slab(tmp_path, airs_of(0.0, 0.1))
    assert file.read_text() == "hours of simulation"
    assert [path.name for path in tmp_path.iterdir()] == ["members"]


def _poses() -> PoseSet:
    places = ((60.0, -40.0, 90.0), (-30.0, 50.0, 100.0))
    return PoseSet(matrices=np.stack([look_at(place, (0.0, 0.0, 0.0)) for place in places]))


def test_sweep_has_the_scatter_of_each_pose(three: Path, tmp_path: Path) -> None:
    """As each pose rendered alone; an interrupted sweep goes on and ends the same."""
    scene = load_scene(three)
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
        assert int(part["worst_member"]) == metrics["ensemble"]["worst_member"] == 3
        assert int(part["ensemble_members"]) == 3
        assert int(part["rays_in_all"]) == metrics["ensemble"]["rays_in_all"]
    plain = xr.open_dataset(path, engine="h5netcdf")
    assert plain["scatter_mean"].attrs["cell_methods"] == "realization: standard_deviation"
    assert plain["scatter_mean"].attrs["units"] == "mm"
    assert plain["displacement_mean"].attrs["cell_methods"] == "realization: mean"
    assert "cell_methods" not in plain["coverage"].attrs
    assert len(json.loads(plain.attrs["scenes"])[0]["members"]) == 3
    plain.close()


def test_a_changed_member_is_another_sweep(tmp_path: Path) -> None:
    """The fingerprint covers every member's files, also those with nothing but indices."""

    def write(share: float) -> Any:
        scene = load_scene(write_slab(tmp_path / "s", airs_of(0.0, share))[0])
        return run_sweep(scene, _poses(), tmp_path / "sweep.nc")

    write(0.1).close()
    write(0.1).close()
    with pytest.raises(InputError, match="another scene"):
        write(0.2)
