"""Many poses in one result: rendered here or by workers, resumed where an earlier run stopped."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
from attrs import field, frozen
from numpy.typing import ArrayLike

from iriftrace.camera.pose_set import PoseSet, joined
from iriftrace.core.arrays import BoolArray
from iriftrace.core.errors import InputError, warn
from iriftrace.image.ray_statistics import FEWEST_RAYS
from iriftrace.image.sightings import COLUMNS, NOTHING_SEEN, ROW, FaceSightings, face_maps
from iriftrace.sweep.journal import Journal, Piece, Progress, Work
from iriftrace.sweep.measures import metric_variables
from iriftrace.sweep.pose import PoseTask, SceneSource, fingerprint, render_pose
from iriftrace.sweep.series import (
    RenderPoses,
    Series,
    all_series,
    check_comparable,
    scenes_attribute,
    series_variables,
    sources_of,
)
from iriftrace.sweep.store import (
    WARNED,
    WHOLE_PART,
    pose_variables,
    read_sweep,
    to_dataset,
    write_sweep,
)
from iriftrace.sweep.warned import warned_variable
from iriftrace.tracing.engine import warn_of_coarse_poses
from iriftrace.tracing.provenance import provenance
from iriftrace.tracing.scene import Scene, ready_scene

if TYPE_CHECKING:
    import xarray as xr


@frozen
class SweepOptions:
    """Amount of work for each pose.

    Attributes
    ----------
    include : tuple of int
        Status codes of the rays that the metrics use.
    exr : bool
        Keep each pose's AOV image in a folder next to the result.
    """

    include: tuple[int, ...] = (0,)
    exr: bool = False


STANDARD_SWEEP = SweepOptions()


def run_sweep(
    scenes: Scene | Sequence[Scene],
    poses: PoseSet | Mapping[float, PoseSet],
    path: str | Path | None = None,
    *,
    focal_lengths_mm: Sequence[float] = (),
    move_out: bool = False,
    target: ArrayLike | None = None,
    options: SweepOptions = STANDARD_SWEEP,
    progress: Progress | None = None,
    render: RenderPoses | None = None,
) -> xr.Dataset:
    """Render scenes from many poses and keep the metrics, in one netCDF file or in memory.

    A scene with two devices is a rigid sensor: they move together, and their measurement from each
    pose is stored next to the camera's metrics (:mod:`iriftrace.sweep.rig`).

    Every combination of scene, focal length and set of poses is swept, in this order of nesting.
    All poses are equals: one `iriftrace.planning.rank.rank_poses` normalises and ranks them
    together, so that fields, focal lengths and distances compete.

    If a file is given, every finished pose enters a journal next to it, so that a sweep that was
    interrupted or killed loses at most the poses in progress. The same call continues where it
    stopped, with the same result except for the times. Memory does not grow with the number of
    poses except for the metrics, some kilobytes a pose.

    Parameters
    ----------
    scenes : Scene, or several
        Scenes of the same part, with the same sensor, which gives the intrinsics. In the result,
        several of one name are numbered: "the scene", "the scene 2".
    poses : PoseSet, or mapping from float to PoseSet
        Camera poses, or those of several orbits by their stand-offs, mm.
    path : path, optional
        The netCDF file; by default the result is in memory alone. Needs scenes of files.
    focal_lengths_mm : sequence of float, mm
        Used instead of the sensor's.
    move_out : bool
        Move cameras that stand in the hot air back along their line of sight. Otherwise such a
        pose is recorded as failed.
    target : (3,) array, mm, world, optional
        Point from which ``distance`` is measured; the part's centre by default.
    options : SweepOptions, optional
    progress : callable, optional
        Called with the number of finished poses and of all poses.
    render : callable, optional
        Renders the poses, as `iriftrace.sweep.workers.pose_workers` does; by default this process.

    Returns
    -------
    xarray.Dataset
        Dimensions ``pose``, ``region``, ``face`` and ``sighting``; see
        :mod:`iriftrace.sweep.measures` and :mod:`iriftrace.image.sightings`.

    Raises
    ------
    InputError
        If there is no pose, the scenes cannot be compared, the camera has no focal length to
        change, cameras stand in the part, the file cannot be written, or it belongs to another
        sweep.

    Warns
    -----
    IriftraceWarning
        If cameras were moved; if more than half of the poses are empty, naming the main reason;
        and about poses as :func:`iriftrace.tracing.engine.choose` warns.
    """
    several = scenes if isinstance(scenes, Sequence) and not isinstance(scenes, str) else [scenes]
    loaded = [ready_scene(one) for one in several]
    series = all_series(loaded, poses, focal_lengths_mm, move_out=move_out)
    return run_series(
        series, path, target=target, options=options, progress=progress, render=render
    )


def run_series(
    series: Sequence[Series],
    path: str | Path | None,
    *,
    target: ArrayLike | None = None,
    options: SweepOptions = STANDARD_SWEEP,
    progress: Progress | None = None,
    render: RenderPoses | None = None,
) -> xr.Dataset:
    """Sweep any series that can be compared, as `run_sweep` does."""
    check_comparable(series, of_files=path is not None or render is not None)
    if path is not None:
        return _Sweep(series, Path(path), target, options).run(progress, render)
    if options.exr:
        raise InputError(
            "Pictures of a sweep are stored next to its file; give the sweep a path.",
            code="sweep.no_path",
            argument="path",
        )
    with TemporaryDirectory() as folder:
        in_file = _Sweep(series, Path(folder) / "sweep.nc", target, options)
        return in_file.run(progress, render).load()


@frozen(eq=False)
class _Sweep:
    """Series to render into one file, and the source of each one's scene."""

    series: Sequence[Series]
    out: Path
    target: ArrayLike | None
    options: SweepOptions
    sources: Sequence[SceneSource | None] = field(init=False)

    @sources.default
    def _sources(self) -> Sequence[SceneSource | None]:
        return sources_of(self.series)

    def run(self, progress: Progress | None, render: RenderPoses | None) -> xr.Dataset:
        work = Work(
            kind="sweep",
            parts="poses, another scene or other options",
            output=self.out,
            request=self.request(),
            total=sum(len(one.poses) for one in self.series),
        )
        render = render or self.render_here

        def write(journal: Journal) -> None:
            dataset = self.dataset(journal)
            dataset.attrs["request"] = work.request
            write_sweep(self.out, dataset, _sightings(journal, work.total))

        fresh = not self.out.is_file()
        dataset = work.run(lambda journal: render(self.tasks(journal)), write, read_sweep, progress)
        if fresh:
            _warn_of_empty_poses(dataset)
            judged = ("engine_test_p95", "engine_test_p95_mm", "through_cells")
            warn_of_coarse_poses(*(dataset[name].values for name in judged))
        return dataset

    def request(self) -> str:
        """Fingerprint of everything that the result depends on."""
        content = [
            [
                source and source.fingerprint,
                one.camera.as_dict(),
                one.stand_off_mm,
                one.poses.matrices.tolist(),
                one.rig
                and [one.scene.second_id, one.rig.device.as_dict(), one.rig.to_first.tolist()],
            ]
            for source, one in zip(self.sources, self.series, strict=True)
        ]
        settings = [list(self.options.include), self.options.exr]
        # A journal's rows have these columns.
        return fingerprint(version("iriftrace"), content, settings, list(COLUMNS))

    def render_here(self, tasks: Iterable[PoseTask]) -> Iterator[Piece]:
        """Render in this process, one pose after the other."""
        for task in tasks:
            yield render_pose(task, self.series[task.series].scene)

    def tasks(self, done: Collection[int]) -> Iterator[PoseTask]:
        """Poses that are not finished, scene by scene: a worker needs one scene at a time."""
        folder, options = self.out.with_suffix("").absolute(), self.options
        if options.exr:
            folder.mkdir(exist_ok=True)
        number = 0
        pairs = zip(self.sources, self.series, strict=True)
        for series, (source, one) in enumerate(pairs):
            for matrix in one.poses.matrices:
                if number not in done:
                    yield PoseTask(
                        number=number,
                        series=series,
                        source=source,
                        camera=one.camera.at(matrix),
                        include=options.include,
                        exr=str(folder / _exr_name(number)) if options.exr else "",
                        second=None if one.rig is None else one.rig.placed(matrix),
                    )
                number += 1

    def dataset(self, journal: Journal) -> xr.Dataset:
        """All variables of the journal, except the faces that each pose sees."""
        series, options = self.series, self.options
        first = series[0]
        part = first.scene.part
        poses = joined(one.poses for one in series)
        rig = None if first.rig is None else first.rig.as_dict(first.scene.second_id)
        numbers = range(len(poses))
        measured = metric_variables(
            map(journal.entry, numbers),
            len(poses),
            part.region_names,
            ensemble=any(one.scene.averages for one in series),
            rig=rig is not None,
        )
        folder = self.out.with_suffix("").name
        images = [
            f"{folder}/{_exr_name(number)}" if options.exr and not failure else ""
            for number, failure in enumerate(measured["failure"][1])
        ]
        found = to_dataset(
            {
                **measured,
                **pose_variables(poses, part.centre if self.target is None else self.target),
                **series_variables(series),
                "exr": (("pose",), np.array(images, dtype=object)),
                **face_maps(_sightings(journal, len(poses)), part),
            },
            part.region_names,
            {
                **provenance(first.scene, first.camera),
                "camera": first.camera.as_dict(),
                "scenes": scenes_attribute(series, self.sources),
                "include": list(options.include),
                **({} if rig is None else {"rig": rig}),
            },
        )
        return found.assign({WARNED: warned_variable(found)})


def _exr_name(number: int) -> str:
    return f"pose_{number:05d}.exr"


def _sightings(journal: Journal, total: int) -> Iterator[FaceSightings]:
    """Faces that each pose sees, one pose at a time."""
    for number in range(total):
        rows = journal.rows(number)
        if rows is not None and rows.dtype != ROW:
            raise sqlite3.DatabaseError(f"piece {number}: its rows are not those of sightings")
        yield NOTHING_SEEN if rows is None else FaceSightings.from_rows(rows)


def _warn_of_empty_poses(dataset: xr.Dataset) -> None:
    """Give the main reason if more than half of the poses are empty."""
    good, hits, blurred, hidden = (
        dataset[f"rays_{key}"].sel(region=WHOLE_PART).values
        for key in ("good", "hit", "out_of_focus", "blocked")
    )
    empty: BoolArray = good < FEWEST_RAYS
    if 2 * empty.sum() <= len(empty):
        return
    reasons = {
        "the camera stands in the hot air or the part, or failed; move the cameras away": good < 0,
        "the part is out of focus; move the cameras to where it is in focus, or widen the focus "
        "interval of the scene's sensor": empty & (blurred >= FEWEST_RAYS),
        "the part is hidden by another object; move the cameras around it": (
            empty & (hidden >= FEWEST_RAYS)
        ),
        "the part is out of the picture; turn the cameras to it": empty & (hits == 0),
        f"the part covers fewer than {FEWEST_RAYS} pixels; move the cameras closer, or use more "
        "pixels or a longer focal length": empty & (hits > 0) & (hits < FEWEST_RAYS),
    }
    reason = max(reasons, key=lambda text: reasons[text].sum())
    warn(
        f"{empty.sum()} of {len(empty)} poses see fewer than {FEWEST_RAYS} good rays, mostly "
        f"because {reason}."
    )
