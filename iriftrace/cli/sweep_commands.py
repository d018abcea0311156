"""The commands ``iriftrace sweep`` and ``iriftrace plan``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from iriftrace.cli.checks import check_input, check_output
from iriftrace.cli.console import notes, out
from iriftrace.cli.options import Variables, variables_of
from iriftrace.cli.orbit_options import OrbitOptions
from iriftrace.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.orbit import PoseSet
    from iriftrace.planning import Plan
    from iriftrace.scene import LoadedScene


class Rate(ProgressColumn):
    """Poses a second."""

    def render(self, task: Task) -> str:
        """Text of the column."""
        return "" if task.speed is None else f"{task.speed:.1f} a second"


def sweep(
    scene: Path,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])],
    orbit: OrbitOptions = OrbitOptions(),
    define: Variables = None,
    variant: str | None = None,
    nearest: bool = False,
    exr: bool = False,
    include: Annotated[list[int] | None, Parameter(negative=())] = None,
    export: Path | None = None,
) -> None:
    """Render a scene from many poses into one netCDF file.

    An interrupted sweep goes on where it stopped when the same command is given again.

    Example: ``iriftrace sweep scene.xml -o sweep.nc --azimuth 0:90:10 --elevation -90:90:19``

    Parameters
    ----------
    scene
        The scene's XML file; its sensor gives the intrinsics.
    output
        The netCDF file.
    define
        Scene parameter, name=value; repeatable.
    variant
        Mitsuba variant, llvm_ad_mono or cuda_ad_mono.
    nearest
        Add the two nearest-neighbour readings of the resolution, which takes longer.
    exr
        Keep each pose's AOV image in a folder beside the result.
    include
        Further status codes whose rays the metrics use, such as 5.
    export
        Write the table of the whole part to this .csv file too.
    """
    from iriftrace.scene import load_scene
    from iriftrace.sweep import SweepOptions, run_sweep
    from iriftrace.sweep_store import write_table

    if export is not None and export.suffix.lower() != ".csv":
        raise InputError(f"--export is {export}, but only .csv can be written; name it so.")
    check_input(scene)
    check_output(output, ".nc", "sweep.nc")
    with notes.status("Loading the scene ..."):
        loaded = load_scene(scene, variables_of(define), variant=variant)
    camera = loaded.camera
    poses = orbit.pose_set(loaded, camera)
    if orbit.poses is None:
        poses = _outside(loaded, poses)
    columns = (
        TextColumn("Poses"),
        BarColumn(),
        MofNCompleteColumn(),
        Rate(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=notes) as bar:
        task = bar.add_task("Poses", total=len(poses))
        started: list[int] = []

        def report(done: int, total: int) -> None:
            # What an earlier run has done must not count as speed.
            if not started:
                started.append(done)
                bar.reset(task, total=total, completed=done)
            bar.update(task, completed=done)

        dataset = run_sweep(
            loaded,
            poses,
            camera,
            output,
            target=orbit.look_at(loaded),
            options=SweepOptions(nearest, (0, *(include or ())), exr),
            progress=report,
        )
    _print_sweep(dataset)
    if export is not None:
        write_table(export, dataset)
    out.print(f"Sweep in {output}; now run:  iriftrace plan {output}", markup=False, soft_wrap=True)


def _outside(scene: LoadedScene, poses: PoseSet) -> PoseSet:
    """Poses inside hot air or part moved back out of it, which is reported."""
    from iriftrace.pose_set import push_out
    from iriftrace.render import is_inside

    with notes.status("Looking where the cameras stand ..."):
        free, moved = push_out(poses, lambda points: is_inside(scene, points))
    if moved.any():
        notes.print(
            f"[bold yellow]warning:[/] {moved.sum()} of {len(poses)} poses stood in the hot air or "
            "the part and were moved back along their line of sight.",
            soft_wrap=True,
        )
    return free


def _print_sweep(dataset: xr.Dataset) -> None:
    whole = dataset.sel(region="part")
    good = whole["rays_good"].values
    failed = [text for text in dataset["failure"].values if text]
    out.print(
        f"{len(good)} poses: {(good >= 100).sum()} with at least 100 good rays, {len(failed)} "
        f"failed{': ' + failed[0] if failed else ''}",
        markup=False,
        soft_wrap=True,
    )
    for name, unit, factor in (
        ("displacement_median", "um", 1e3),
        ("coverage_area", "%", 100),
        ("lateral_resolution", "um", 1e3),
    ):
        values = whole[name].values * factor
        if np.isfinite(values).any():
            out.print(
                f"  {name.replace('_', ' ')}: {np.nanmin(values):.3g} to {np.nanmax(values):.3g} "
                f"{unit}"
            )


def plan(
    sweep: Path,
    *,
    displacement: float = 0.5,
    coverage: float = 0.2,
    axial: float = 0.15,
    lateral: float = 0.15,
    statistic: Literal["mean", "median", "p95"] = "mean",
    resolution: Literal["step", "nn3d", "nnxy"] = "step",
    region: str = "part",
    percentile: float = 95.0,
    outside: Literal["clip", "discard"] = "clip",
    min_hits: int = 100,
    top: int = 10,
) -> None:
    """Rank the poses of a sweep by the combined metric and print the best one.

    Example: ``iriftrace plan sweep.nc --statistic median --region lateral``

    Parameters
    ----------
    sweep
        A file that ``iriftrace sweep`` wrote.
    displacement, coverage, axial, lateral
        Weights of the normalised metrics: score = displacement d + coverage (1 - c) + axial a +
        lateral l, the smaller the better.
    statistic
        Which displacement: the paper's mean, or one that silhouettes cannot spoil.
    resolution
        Reading of the resolution.
    region
        Region of the part.
    percentile
        Upper end of the normalisation.
    outside
        What becomes of poses beyond the percentile.
    min_hits
        Poses with fewer good rays stay unranked.
    top
        Rows of the ranking to print.
    """
    from iriftrace.planning import Weights, pareto_front, rank_poses, stability
    from iriftrace.sweep_store import read_sweep

    dataset = read_sweep(sweep)
    weights = Weights(displacement, coverage, axial, lateral)
    settings: dict[str, Any] = {"statistic": statistic, "resolution": resolution, "region": region}
    result = rank_poses(
        dataset,
        weights=weights,
        percentile=percentile,
        outside=outside,
        min_hits=min_hits,
        **settings,
    )
    _print_ranking(dataset, result, settings, top)
    varied = stability(result)
    out.print(
        f"When one weight varies by +-50 %, the best pose ranks {varied.worst_rank} at worst; when "
        f"all do, {len(varied.rivals)} other poses can beat it.",
        soft_wrap=True,
    )
    front = pareto_front(dataset, min_hits=min_hits, **settings)
    out.print(
        "Not beaten in displacement, coverage and resolution at once (Pareto front): poses "
        + ", ".join(map(str, front)),
        soft_wrap=True,
    )
    _print_best(dataset, result.best)


def _print_ranking(dataset: xr.Dataset, result: Plan, settings: dict[str, Any], top: int) -> None:
    view = dataset.sel(region=settings["region"])
    suffix = "" if settings["resolution"] == "step" else f"_{settings['resolution']}"
    columns: dict[str, tuple[str, float]] = {
        f"{settings['statistic']} um": (
            f"displacement_{settings['statistic']}",
            1e3,
        ),
        "cover %": ("coverage", 100.0),
        "axial um": (f"axial_resolution{suffix}", 1e3),
        "lateral um": (f"lateral_resolution{suffix}", 1e3),
    }
    table = Table(
        title=f"Best poses for region {settings['region']}: displacement, coverage, resolution",
        title_justify="left",
    )
    for heading in ("rank", "pose", "azim.", "elev.", "score", *columns):
        table.add_column(heading, justify="right")
    for rank, pose in enumerate(result.order[:top], start=1):
        table.add_row(
            str(rank),
            str(pose),
            f"{float(dataset['azimuth'][pose]):.1f}",
            f"{float(dataset['elevation'][pose]):.1f}",
            f"{result.score[pose]:.3f}",
            *(f"{float(view[name][pose]) * factor:.4g}" for name, factor in columns.values()),
        )
    out.print(table)
    for pose, reason in list(result.unranked.items())[:1]:
        out.print(
            f"{len(result.unranked)} poses unranked, the first of them {pose}: {reason}",
            markup=False,
            soft_wrap=True,
        )


def _print_best(dataset: xr.Dataset, pose: int) -> None:
    matrix = dataset["matrix"].values[pose]
    origin, forward, up = matrix[:3, 3], matrix[:3, 2], -matrix[:3, 1]
    target = origin + float(dataset["distance"][pose]) * forward
    out.print(f"Best pose {pose}, camera to world (x right, y down, z forward):")
    for row in matrix:
        out.print("  " + "  ".join(f"{value:12.6f}" for value in row))
    texts = [", ".join(f"{value:.6f}" for value in v + 0.0) for v in (origin, target, up)]
    out.print("For the scene file:")
    out.print(
        f'  <lookat origin="{texts[0]}" target="{texts[1]}" up="{texts[2]}"/>',
        markup=False,
        soft_wrap=True,
    )
