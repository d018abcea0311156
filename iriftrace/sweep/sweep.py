"""Many poses in one result: rendered here or by workers, never lost, resumed where they stopped."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen
from numpy.typing import ArrayLike

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose_set import PoseSet, joined
from iriftrace.core.errors import InputError
from iriftrace.image.sightings import face_maps
from iriftrace.scene.load import LoadedScene
from iriftrace.sweep.diagnostics import warn_of_empty_poses
from iriftrace.sweep.journal import Journal, journal_of, remove_leftovers, sole_writer
from iriftrace.sweep.measures import metric_variables
from iriftrace.sweep.pose import PoseTask, SceneSource, fingerprint
from iriftrace.sweep.series import (
    RenderPoses,
    Series,
    check_comparable,
    render_here,
    scenes_attribute,
    series_variables,
    sources_of,
)
from iriftrace.sweep.store import pose_variables, read_sweep, to_dataset, write_sweep
from iriftrace.trace.provenance import provenance
from iriftrace.trace.shell_convergence import warn_of_coarse_poses

if TYPE_CHECKING:
    import xarray as xr


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
    render: RenderPoses | None = None,
) -> xr.Dataset:
    """Render one scene from many poses; see `run_series`."""
    return run_series(
        [Series(scene, camera, poses)],
        path,
        target=target,
        options=options,
        progress=progress,
        render=render,
    )


def run_series(
    series: Sequence[Series],
    path: str | Path,
    *,
    target: ArrayLike | None = None,
    options: SweepOptions | None = None,
    progress: Callable[[int, int], None] | None = None,
    render: RenderPoses | None = None,
) -> xr.Dataset:
    """Render every pose of every series and keep the metrics in one netCDF file.

    Every finished pose goes into a journal beside the file, so that a sweep that was interrupted
    or killed loses the poses in flight at most: the same call goes on where it stopped, and its
    result is the same but for the times. The journal is removed when the file is complete. Memory
    does not grow with the number of poses but for the metrics, some kilobytes a pose.

    All poses of all series are equals: one `iriftrace.planning.rank.rank_poses` normalises and
    ranks them together, so that fields, focal lengths and distances compete.

    Parameters
    ----------
    series : sequence of Series
        Scenes of the same part, and cameras that differ in nothing but focal length and pose.
    path : path
        The netCDF file.
    target : (3,) array, mm, world, optional
        Point from which ``distance`` is measured; the part's centre by default.
    options : SweepOptions, optional
    progress : callable, optional
        Called with the number of finished poses and of all poses.
    render : callable, optional
        Who renders; this process by default, else what `iriftrace.sweep.workers.workers` gives.

    Returns
    -------
    xarray.Dataset
        Dimensions ``pose``, ``region``, ``face`` and ``sighting``; see
        :mod:`iriftrace.sweep.measures` and :mod:`iriftrace.image.sightings`.

    Raises
    ------
    InputError
        If there is no pose, the scenes cannot be compared, the file cannot be written, or it
        belongs to another sweep.

    Warns
    -----
    IriftraceWarning
        If more than half of the poses are empty, naming the main reason; and if there are poses
        for whose single rays the shells are too few.
    """
    chosen = options or SweepOptions()
    out = Path(path)
    check_comparable(series)
    if not out.parent.is_dir():
        raise InputError(f"The folder {out.parent} does not exist; create it first.")
    sources = sources_of(series)
    request = _request(series, sources, chosen)
    folder = journal_of(out)
    if out.is_file():
        finished = _finished(out, request)
        remove_leftovers(folder, request)
        return finished
    total = sum(len(one.poses) for one in series)
    with sole_writer(folder):
        journal = Journal(folder, request)
        if progress is not None:
            progress(len(journal), total)
        tasks = _tasks(series, sources, chosen, out, journal)
        for result in (render or render_here(series, sources))(tasks):
            journal.add(result)
            if progress is not None:
                progress(len(journal), total)
        dataset = _dataset(series, sources, journal, chosen, out, target)
        dataset.attrs["request"] = request
        write_sweep(out, dataset, (journal.sightings(pose) for pose in range(total)))
        journal.close()
    finished = read_sweep(out)
    warn_of_empty_poses(finished)
    warn_of_coarse_poses(finished["every_second_shell_p95"].values)
    return finished


def _finished(out: Path, request: str) -> xr.Dataset:
    """The result of an earlier run, which is never replaced."""
    advice = "delete it, or give another name with -o"
    try:
        dataset = read_sweep(out)
    except InputError as error:
        raise InputError(f"{out} is there already and is no sweep; {advice}.") from error
    if dataset.attrs.get("request") != request:
        dataset.close()
        raise InputError(
            f"{out} holds a sweep of other poses, another scene or other options; {advice}."
        )
    return dataset


def _request(
    series: Sequence[Series], sources: Sequence[SceneSource], options: SweepOptions
) -> str:
    """What tells one sweep from another."""
    content = [
        [source.fingerprint, one.camera.as_dict(), one.stand_off_mm, one.poses.matrices.tolist()]
        for source, one in zip(sources, series, strict=True)
    ]
    wanted = [options.nearest, list(options.include), options.exr]
    return fingerprint(version("iriftrace"), content, wanted)


def _tasks(
    series: Sequence[Series],
    sources: Sequence[SceneSource],
    options: SweepOptions,
    out: Path,
    done: Collection[int],
) -> Iterator[PoseTask]:
    """What is left to do, scene by scene, so that a worker needs one scene at a time."""
    folder = out.with_suffix("").absolute()
    if options.exr:
        folder.mkdir(exist_ok=True)
    number = 0
    for source, one in zip(sources, series, strict=True):
        for matrix in one.poses.matrices:
            if number not in done:
                yield PoseTask(
                    number=number,
                    source=source,
                    camera=one.camera.at(matrix),
                    include=options.include,
                    nearest=options.nearest,
                    exr=str(folder / _exr_name(number)) if options.exr else "",
                )
            number += 1


def _exr_name(number: int) -> str:
    return f"pose_{number:05d}.exr"


def _dataset(
    series: Sequence[Series],
    sources: Sequence[SceneSource],
    journal: Journal,
    options: SweepOptions,
    out: Path,
    target: ArrayLike | None,
) -> xr.Dataset:
    """All that the journal holds, but for what each pose sees of each face."""
    first = series[0]
    part = first.scene.part
    poses = joined(one.poses for one in series)
    numbers = range(len(poses))
    measured = metric_variables(
        map(journal.entry, numbers),
        len(poses),
        part.region_names,
        ensemble=any(one.scene.ensemble is not None for one in series),
    )
    failures = measured["failure"][1]
    images = [
        f"{out.with_suffix('').name}/{_exr_name(number)}" if options.exr and not failure else ""
        for number, failure in enumerate(failures)
    ]
    return to_dataset(
        {
            **measured,
            **pose_variables(poses, part.centre if target is None else target),
            **series_variables(series),
            "exr": (("pose",), np.array(images, dtype=object)),
            **face_maps(map(journal.sightings, numbers), part),
        },
        part.region_names,
        {
            **provenance(first.scene, first.camera),
            "camera": first.camera.as_dict(),
            "scenes": scenes_attribute(series, sources),
            "include": list(options.include),
        },
    )
