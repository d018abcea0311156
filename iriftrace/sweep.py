"""Many poses of one scene: rendered one after the other, never lost, resumed where they stopped."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from attrs import frozen
from numpy.typing import ArrayLike, NDArray

from iriftrace.camera import Camera
from iriftrace.errors import InputError, IriftraceWarning
from iriftrace.orbit import PoseSet
from iriftrace.part_file import sha256_of
from iriftrace.provenance import provenance
from iriftrace.render import render_scene
from iriftrace.scene import LoadedScene
from iriftrace.sweep_store import Journal, fingerprint, read_sweep, to_dataset, write_sweep

if TYPE_CHECKING:
    import xarray as xr

FEWEST_RAYS = 100
"""A pose with fewer good rays counts as empty."""


@frozen
class SweepOptions:
    """What is computed of each pose.

    Attributes
    ----------
    nearest : bool
        Search nearest neighbours for the resolutions ``*_nn3d`` and ``*_nnxy`` too.
    include : tuple of int
        Status codes whose rays the metrics use.
    exr : bool
        Keep each pose's AOV image in a folder beside the result.
    """

    nearest: bool = False
    include: tuple[int, ...] = (0,)
    exr: bool = False


def run_sweep(
    scene: LoadedScene,
    poses: PoseSet,
    camera: Camera,
    path: str | Path,
    *,
    target: ArrayLike | None = None,
    options: SweepOptions | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Render every pose and keep the metrics in one netCDF file.

    Every finished pose goes into a journal beside the file, so that a sweep that was interrupted
    or killed loses the pose in flight at most: the same call goes on where it stopped, and its
    result is the same but for the times. The journal is removed when the file is complete.

    Parameters
    ----------
    scene : LoadedScene
    poses : PoseSet
    camera : Camera
        Intrinsics and focus interval; its pose is not used.
    path : path
        The netCDF file.
    target : (3,) array, mm, world, optional
        Point from which ``distance`` is measured; the part's centre by default.
    options : SweepOptions, optional
    progress : callable, optional
        Called with the number of finished poses and of all poses.

    Returns
    -------
    xarray.Dataset
        Dimensions ``pose`` and ``region``; see :mod:`iriftrace.sweep_store`.

    Raises
    ------
    InputError
        If there is no pose, the file cannot be written, or it belongs to another sweep.

    Warns
    -----
    IriftraceWarning
        If more than half of the poses are empty, naming the main reason.
    """
    chosen = options or SweepOptions()
    out = Path(path)
    if len(poses) == 0:
        raise InputError("The sweep has no pose; give angles or a list of poses.")
    if not out.parent.is_dir():
        raise InputError(f"The folder {out.parent} does not exist; create it first.")
    request = fingerprint(
        version("iriftrace"),
        sha256_of(scene.path),
        scene.part.sha256,
        scene.normals,
        scene.variant,
        camera.as_dict(),
        poses.matrices,
        [chosen.nearest, list(chosen.include), chosen.exr],
    )
    if out.is_file():
        finished = read_sweep(out)
        if finished.attrs.get("request") != request:
            raise InputError(
                f"{out} holds a sweep of other poses, another scene or other options; delete it, "
                "or give another name with -o."
            )
        return finished
    journal = Journal(out.with_name(out.name + ".journal"), request)
    for number, matrix in enumerate(poses.matrices):
        if progress is not None:
            progress(len(journal.done), len(poses))
        if number not in journal.done:
            journal.add(number, _pose(scene, camera.at(matrix), number, out, chosen))
    if progress is not None:
        progress(len(poses), len(poses))
    dataset = to_dataset(
        poses,
        [journal.done[number] for number in range(len(poses))],
        scene.part.region_names,
        np.asarray(scene.part.centre if target is None else target, dtype=np.float64),
        {
            **provenance(scene, camera.projection),
            "camera": camera.as_dict(),
            "include": list(chosen.include),
            "request": request,
        },
    )
    write_sweep(out, dataset)
    journal.path.unlink()
    _warn_if_empty(dataset)
    return dataset


def _pose(
    scene: LoadedScene, camera: Camera, number: int, out: Path, options: SweepOptions
) -> dict[str, Any]:
    """What the journal records of one pose."""
    try:
        with warnings.catch_warnings():
            # Said once for the sweep, and not for every pose.
            warnings.simplefilter("ignore", IriftraceWarning)
            rendering = render_scene(
                scene, camera=camera, include=options.include, nearest=options.nearest, empty=True
            )
        exr = ""
        if options.exr:
            folder = out.with_suffix("")
            folder.mkdir(exist_ok=True)
            file, _ = rendering.save(folder / f"pose_{number:05d}.exr")
            exr = f"{folder.name}/{file.name}"
    except InputError as error:
        return {"metrics": None, "failure": str(error), "exr": ""}
    metrics = rendering.metrics
    kept = ("rays", "time_s", "shell_triangles_in_view", "regions")
    measured = {key: value for key, value in metrics.items() if key in kept or _is_measure(key)}
    return {"metrics": measured, "failure": "", "exr": exr}


def _is_measure(key: str) -> bool:
    return key.endswith(("_mm", "_px", "_deg", "_nn3d", "_nnxy")) or key.startswith("coverage")


def _warn_if_empty(dataset: xr.Dataset) -> None:
    good = dataset["rays_good"].sel(region="part").values
    empty: NDArray[np.bool_] = good < FEWEST_RAYS
    if 2 * empty.sum() <= len(empty):
        return
    reasons = {
        "the camera stands in the hot air or the part, or failed": (good < 0).sum(),
        "the part is out of focus": _most(dataset, "rays_out_of_focus", empty),
        "the part is hidden by another object": _most(dataset, "rays_blocked", empty),
        "the part is out of the picture": (
            empty & (dataset["rays_hit"].sel(region="part").values == 0)
        ).sum(),
    }
    reason = max(reasons, key=lambda text: reasons[text])
    warnings.warn(
        f"{empty.sum()} of {len(empty)} poses see fewer than {FEWEST_RAYS} good rays, mostly "
        f"because {reason}; change the orbit, the focus interval or the focal length.",
        IriftraceWarning,
        stacklevel=3,
    )


def _most(dataset: xr.Dataset, name: str, empty: NDArray[np.bool_]) -> int:
    counts = dataset[name].sel(region="part").values
    return int((empty & (counts >= FEWEST_RAYS)).sum())
