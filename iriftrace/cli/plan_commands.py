"""The command ``iriftrace plan``: where to put the camera, by a sweep."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Group, Parameter

from iriftrace.cli.checks import check_input, check_output
from iriftrace.cli.console import notes, out
from iriftrace.cli.options import Whole, quantity, quantity_with_unit
from iriftrace.cli.plan_options import THE_PAPERS, RankingOptions
from iriftrace.cli.traced_light import check_light
from iriftrace.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.planning import Plan
    from iriftrace.refine import Refinement
    from iriftrace.swept_scene import SweptScene

VIEWS = Group("Several views", sort_key=2)
REFINE = Group("Refinement", sort_key=3)
POSES = Group("Poses for other programs", sort_key=4)

EVALUATIONS = 80


def plan(
    sweep: Path,
    *,
    ranking: RankingOptions = THE_PAPERS,
    top: Whole = 10,
    wavelength: str | None = None,
    views: Annotated[Whole | None, Parameter(group=VIEWS)] = None,
    max_displacement: Annotated[str | None, Parameter(group=VIEWS)] = None,
    max_incidence: Annotated[str | None, Parameter(group=VIEWS)] = None,
    refine: Annotated[bool, Parameter(group=REFINE, negative=())] = False,
    evaluations: Annotated[Whole | None, Parameter(group=REFINE)] = None,
    output: Annotated[Path | None, Parameter(name=["-o", "--output"], group=REFINE)] = None,
    save_poses: Annotated[Path | None, Parameter(group=POSES)] = None,
    convention: Annotated[
        Literal["opencv", "mitsuba", "opengl", "ros", "paper"] | None, Parameter(group=POSES)
    ] = None,
) -> None:
    """Rank the poses of a sweep by the combined metric and print the best one.

    With --views, also the set of poses that together see the most of the part; with --refine, also
    the best pose near the best one of the sweep.

    Example: ``iriftrace plan sweep.nc --statistic median --region lateral``

    Parameters
    ----------
    sweep
        A file that ``iriftrace sweep`` wrote.
    top
        Rows of the ranking to print.
    wavelength
        Wavelength that the sweep must be of, "450 nm"; one of other light is refused.
    views
        Number of poses that together are to see as much area as possible.
    max_displacement
        A pose does not see a face whose mean displacement is larger, with its unit: "20 um".
    max_incidence
        A pose does not see a face that its rays hit at a larger angle, in degrees.
    refine
        Search around the best pose, with position, distance and roll free; needs the scene's files.
    evaluations
        Most poses that the search renders, 80 by default.
    output
        Write the refined pose to this .json file.
    save_poses
        Write the poses of the printed ranking, best first, to this .csv, .json, .npy or .txt file.
    convention
        Camera axes in that file, opencv (x right, y down, z forward) by default.
    """
    from iriftrace.cli.plan_output import print_plan, print_refined, print_views
    from iriftrace.plan_table import ranking_table
    from iriftrace.refine import check_evaluations
    from iriftrace.refined_file import write_refined
    from iriftrace.sweep_store import read_sweep
    from iriftrace.view_plan import ViewLimits, plan_views

    _refuse_without(
        "--views",
        views is not None,
        {"--max-displacement": max_displacement, "--max-incidence": max_incidence},
    )
    _refuse_without("--save-poses", save_poses is not None, {"--convention": convention})
    _refuse_without("--refine", refine, {"--evaluations": evaluations, "--output": output})
    limits = ViewLimits(
        displacement_mm=math.inf
        if max_displacement is None
        else quantity_with_unit(max_displacement, "mm", "--max-displacement", "20 um"),
        incidence_deg=90.0
        if max_incidence is None
        else quantity(max_incidence, "degree", "--max-incidence"),
    )
    if output is not None:
        check_output(output, ".json", "refined.json", make=False)
    check_input(sweep)
    dataset = read_sweep(sweep)
    check_light(wavelength, dataset.attrs, sweep)
    summary = ranking.summary_of(dataset)
    table = ranking_table(summary, top)
    if views is not None:
        together = plan_views(
            dataset, views, limits, region=ranking.region, min_hits=ranking.min_hits
        )
    count = EVALUATIONS if evaluations is None else evaluations
    if refine:
        check_evaluations(count)
        swept = _scene_of(dataset, summary.plan.best)
    if save_poses is not None:
        _save(save_poses, dataset, summary.plan.order[:top], convention or "opencv")
    # All that can be wrong has been found by now, so that nothing is printed in vain.
    print_plan(out, summary, table)
    if views is not None:
        print_views(out, summary, together, limits)
    if refine:
        refined = _refined(dataset, summary.plan, swept, count)
        print_refined(out, summary, refined)
        if output is not None:
            write_refined(output, refined, summary.plan, dataset)
            out.print(f"Refined pose in {output}", markup=False, soft_wrap=True)
    if save_poses is not None:
        out.print(f"Ranked poses in {save_poses}", markup=False, soft_wrap=True)


def _save(path: Path, dataset: xr.Dataset, ranked: Any, convention: str) -> None:
    from iriftrace.pose_files import write_poses
    from iriftrace.pose_set import PoseSet

    if not path.parent.is_dir():
        raise InputError(f"The folder {path.parent} does not exist; create it first.")
    chosen = dataset.isel(pose=list(ranked))
    poses = PoseSet(chosen["matrix"].values, chosen["azimuth"].values, chosen["elevation"].values)
    write_poses(path, poses, convention)


def _refuse_without(needed: str, there: bool, options: dict[str, Any]) -> None:
    for name, value in options.items():
        if value is not None and not there:
            raise InputError(f"{name} is given without {needed}, so it changes nothing; add it.")


def _scene_of(dataset: xr.Dataset, pose: int) -> SweptScene:
    from iriftrace.swept_scene import load_swept_scene

    with notes.status("Loading the scene ..."):
        try:
            return load_swept_scene(dataset, pose)
        except InputError as error:
            raise InputError(
                f"The best pose cannot be refined, because its scene cannot be rendered again: "
                f"{error}."
            ) from error


def _refined(dataset: xr.Dataset, plan: Plan, swept: SweptScene, evaluations: int) -> Refinement:
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    from iriftrace.refine import refine_pose

    columns = (
        TextColumn("Refining, best score {task.fields[score]:.4f}"),
        BarColumn(),
        MofNCompleteColumn(),
    )
    with Progress(*columns, console=notes, transient=True) as bar:
        task = bar.add_task("", total=evaluations, score=plan.score[plan.best])
        return refine_pose(
            dataset,
            plan,
            swept,
            evaluations=evaluations,
            progress=lambda done, score: bar.update(task, completed=done, score=score),
        )
