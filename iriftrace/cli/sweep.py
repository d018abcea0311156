"""The command ``iriftrace sweep``."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np

from iriftrace.cli import checks
from iriftrace.cli.console import command_line, notes, pose_progress, say
from iriftrace.cli.groups import group
from iriftrace.cli.options import Output
from iriftrace.cli.trace_options import Statuses, Tracing, load, statuses
from iriftrace.core.errors import InputError
from iriftrace.core.number_lists import Lengths
from iriftrace.core.units import counted
from iriftrace.sweep.options import LOCAL, NO_WORKERS, SweepPoses, Workers
from iriftrace.tracing.options import TRACE_AS_STATED

if TYPE_CHECKING:
    import xarray as xr


def sweep(
    scenes: list[Path],
    /,
    *,
    output: Output,
    orbit: Annotated[SweepPoses, group(SweepPoses, "Orbit", 1)] = SweepPoses(),
    focal_length: Lengths | None = None,
    trace: Tracing = TRACE_AS_STATED,
    exr: bool = False,
    include: Statuses = None,
    export: Path | None = None,
    surface: Path | None = None,
    workers: Annotated[Workers, group(Workers)] = NO_WORKERS,
) -> None:
    """Render scenes from many poses into one netCDF file.

    An interrupted sweep continues where it stopped if the same command is given again.
    Several scenes of the same part (one field each), focal lengths and stand-offs give all their
    combinations, whose poses `iriftrace plan` normalises and ranks together. A scene with two
    devices is a rigid sensor: both move together, and their errors are stored too.

    Example: ``iriftrace sweep scene.xml -o sweep.nc --azimuth 0:90:10 --elevation -90:90:19``

    Parameters
    ----------
    scenes
        The scene's XML file; its sensor gives the intrinsics. Or several, one for each field, with
        the same part and sensor.
    output
        The netCDF file.
    focal_length
        Used instead of the sensor's focal length: one or several, "8mm,10mm".
    exr
        Keep each pose's AOV image in a folder next to the result.
    export
        Also write the table of the whole part to this .csv or .parquet file.
    surface
        Also write the part with the maps of all poses (displacement, times seen, best incidence)
        to this .vtp or .vtu file, for ParaView.
    """
    from iriftrace.sweep.export import check_table, write_face_maps, write_table
    from iriftrace.sweep.sweep import SweepOptions, run_sweep
    from iriftrace.sweep.workers import check_scheduler, pose_workers

    scheduler = workers.address
    checks.inputs(*scenes)
    twice = [scene for scene in scenes if scenes.count(scene) > 1]
    if twice:
        raise InputError(
            f"{twice[0]} is given twice, so its poses would count twice; remove one.",
            code="scene.twice",
        )
    checks.output(output, "sweep.nc")
    checks.output(export, "sweep.csv", ".parquet")
    if export is not None:
        check_table(export)
    checks.output(surface, "part.vtp", ".vtu")
    check_scheduler(scheduler, workers.workers)
    loaded = [load(scene, trace) for scene in scenes]
    checks.inputs(orbit.hand_eye, orbit.base_to_part)
    poses = orbit.pose_sets(loaded[0])
    if orbit.poses is not None:
        ((_, listed),) = poses.items()
        far = np.linalg.norm(listed.origins - loaded[0].part.centre, axis=1)
        say(f"Poses {far.min():.4g} to {far.max():.4g} mm from the part's middle.")
    if orbit.is_default and focal_length is None:
        from iriftrace.cli.output import print_default_orbit

        ((stand_off, around),) = poses.items()
        print_default_orbit(stand_off, around, loaded[0].part, loaded[0].camera)
    render, complete = None, output.is_file()
    with ExitStack() as stack:
        if scheduler is not None:
            starting = scheduler == LOCAL
            with notes.status("Starting workers ..." if starting else f"Calling {scheduler} ..."):
                render = stack.enter_context(pose_workers(scheduler, workers.workers))
        report = stack.enter_context(pose_progress(output))
        dataset = run_sweep(
            loaded,
            poses,
            output,
            focal_lengths_mm=[float(length) for length in focal_length or ()],
            move_out=orbit.is_orbit,
            target=orbit.look_at(loaded[0]),
            options=SweepOptions(statuses(include), exr),
            progress=report,
            render=render,
        )
    if complete:
        say(f"{output} was complete already; nothing was traced.")
    _print_sweep(dataset)
    if export is not None:
        write_table(export, dataset)
        say(f"Table in {export}")
    if surface is not None:
        write_face_maps(surface, dataset, loaded[0].part)
        say(f"Part with the maps of all poses in {surface}")
    say(f"Sweep in {output}; now run:  {command_line('plan', output)}")


def _print_sweep(dataset: xr.Dataset) -> None:
    from iriftrace.sweep.store import attribute
    from iriftrace.sweep.warned import FLAGS, warned_of

    whole = dataset.sel(region="part")
    good = whole["rays_good"].values
    failed = [text for text in dataset["failure"].values if text]
    blurred = (whole["rays_out_of_focus"].values > 0) & (good == 0)
    say(
        f"{counted(len(good), 'pose')}: {(good >= 100).sum()} with at least 100 good rays, "
        f"{blurred.sum()} ({blurred.mean():.0%}) with nothing in focus, {len(failed)} failed"
        f"{': ' + failed[0] if failed else ''}"
    )
    for name, unit, factor in (
        ("displacement_median", "um", 1e3),
        ("scatter_median", "um", 1e3),
        ("error_normal_p95", "um", 1e3),
        ("coverage_measured", "%", 100),
        ("coverage_area", "%", 100),
        ("lateral_resolution", "um", 1e3),
    ):
        values = whole[name].values * factor if name in whole else np.nan
        if np.isfinite(values).any():
            say(
                f"  {name.replace('_', ' ')}: {np.nanmin(values):.4g} to {np.nanmax(values):.4g} "
                f"{unit}"
            )
    assumed = attribute(dataset, "assumptions").get("field_origin", "not stated")
    if assumed != "not stated":
        say(f"  field: {assumed}")
    flags = warned_of(dataset).sum(axis=0).tolist()
    texts = [f"{n} {flag.text}" for n, flag in zip(flags, FLAGS, strict=True) if n]
    if texts:
        say(f"  poses warned of: {'; '.join(texts)}")
    area = dataset["face_area"].values
    seen = area @ dataset["face_seen"].values / area.sum()
    say(f"  seen by some pose: {100 * seen:.3g} % of the area")
