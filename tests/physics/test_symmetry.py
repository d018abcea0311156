"""A symmetric field about a symmetric part gives a symmetric sweep."""

from pathlib import Path

import attrs
import numpy as np
import pytest
import xarray as xr

from iriftrace.camera.orbit import Orbit, orbit_poses
from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part
from iriftrace.io.shells import load_shells
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.medium.shells.stack import Shell, ShellStack
from iriftrace.scenes import folder_of
from iriftrace.sweep.sweep import run_sweep
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.write import write_scene
from validation.inputs.solved_fields import DATA

FIELD = DATA / "cylinder_A.vtu"
MIRROR = np.array((1.0, -1.0, 1.0), dtype=np.float32)
DERIVATIVES_MIRROR = np.array((1, 1, 1, 1, -1, 1, -1), dtype=np.float32)
"""Of the length, and of xx, yy, zz, yz, xz and xy."""

MEASURES = ("displacement_median", "displacement_p95", "shift_median", "coverage_area")


def mirrored(shell: Shell) -> Shell:
    """One half of a shell and its mirror image; no triangle of this field reaches across y = 0."""
    half = shell.faces[shell.vertices[shell.faces][:, :, 1].mean(axis=1) > 0]
    image = half[:, ::-1] + len(shell.vertices)
    return attrs.evolve(
        shell,
        vertices=np.concatenate((shell.vertices, shell.vertices * MIRROR)),
        faces=np.concatenate((half, image)),
        normals=np.concatenate((shell.normals, shell.normals * MIRROR)),
        derivatives=np.concatenate((shell.derivatives, shell.derivatives * DERIVATIVES_MIRROR)),
    )


def sweep_both_sides(folder: Path, stack: ShellStack) -> xr.Dataset:
    """Poses to the left and the right of the plane y = 0, at three elevations."""
    bundled = load_scene(folder_of("cylinder") / "scene.xml", {"scale": 0.1})
    part = read_part(folder_of("cylinder") / "part.ply")
    scene = load_scene(write_scene(folder, part, stack, bundled.camera, paraview=False))
    orbit = Orbit(centre=part.centre, semi_axes_mm=(310.0, 238.5, 238.5))
    poses = orbit_poses(orbit, np.array((-50.0, 50.0)), np.array((-30.0, 10.0, 40.0)), part.centre)
    return run_sweep(scene, poses, folder / "sweep.nc")


def pairs(dataset: xr.Dataset, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Values of the poses on the two sides, in one order."""
    values = dataset.sel(region="part")[name].values
    azimuth, elevation = dataset["azimuth"].values, dataset["elevation"].values
    order = np.argsort(elevation)
    left, right = (values[order][azimuth[order] == side] for side in (310, 50))
    assert len(left) == len(right) == 3
    return left, right


@pytest.fixture(scope="module")
def stack() -> ShellStack:
    return load_shells(folder_of("cylinder") / "shells")


@pytest.mark.usefixtures("variant")
def test_mirror_poses_agree_on_a_mirrored_mesh(tmp_path: Path, stack: ShellStack) -> None:
    """Medians within 1e-6 relative: the tracer itself knows no left and right."""
    symmetric = attrs.evolve(stack, shells=[mirrored(shell) for shell in stack.shells])
    dataset = sweep_both_sides(tmp_path, symmetric)
    for name in ("displacement_median", "shift_median"):
        left, right = pairs(dataset, name)
        assert (left > 0).all()
        np.testing.assert_allclose(left, right, rtol=1e-6)
    left, right = pairs(dataset, "rays_good")
    np.testing.assert_allclose(left, right, atol=2)


@pytest.mark.slow
@pytest.mark.usefixtures("variant")
def test_mirror_poses_nearly_agree_on_the_solvers_mesh(tmp_path: Path) -> None:
    """The field was solved on one half; only its cells are cut differently on the two sides.

    By 0.2 % at most (measured).
    """
    dataset = sweep_both_sides(tmp_path, contour_shells(read_field(FIELD)))
    for name in MEASURES:
        left, right = pairs(dataset, name)
        np.testing.assert_allclose(left, right, rtol=0.005)
