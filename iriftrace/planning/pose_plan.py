"""A plan: ranked poses, sets of views, and a search around the best pose."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from attrs import frozen

from iriftrace.core.errors import InputError
from iriftrace.planning.cover import ViewSet, plan_views
from iriftrace.planning.criteria import STANDARD_CRITERIA, Criteria, Views
from iriftrace.planning.refine import Refinement, check_evaluations, refine_pose
from iriftrace.planning.summary import SweepSummary, summarise
from iriftrace.sweep.reload import load_swept_scene

if TYPE_CHECKING:
    import xarray as xr


@frozen(eq=False)
class PosePlan:
    """The best camera poses of a sweep.

    Attributes
    ----------
    summary : SweepSummary
        Its ``plan`` is the ranking.
    views : ViewSet or None
        Poses that together see the most.
    refined : Refinement or None
        The best pose near the best one of the sweep.
    """

    summary: SweepSummary
    views: ViewSet | None = None
    refined: Refinement | None = None


def plan(
    sweep: xr.Dataset,
    criteria: Criteria = STANDARD_CRITERIA,
    *,
    views: Views | None = None,
    evaluations: int | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> PosePlan:
    """Rank the poses of a sweep; choose views and refine the best pose if requested.

    Parameters
    ----------
    sweep : Dataset
        A sweep that `iriftrace.run_sweep` returned or `iriftrace.read_sweep` has read.
    criteria : Criteria
        Weights, normalisation and requirements for a pose.
    views : Views, optional
        Number of poses that together see as much area as possible, and limits within which they
        must see a face.
    evaluations : int, optional
        Maximum number of poses to render in a search around the best pose, at least 10; needs the
        scene's files.
    progress : callable, optional
        Called after each of these with their number and the best score so far.

    Raises
    ------
    InputError
        No pose can be ranked, nothing is seen within the limits, or the
        scene has changed since the sweep.
    SetupError
        Poses are to be rendered and there is no usable LLVM or CUDA.
    """
    summary = summarise(sweep, criteria)
    together = refined = None
    if views is not None:
        together = plan_views(sweep, views, criteria)
    if evaluations is not None:
        check_evaluations(evaluations)
        try:
            swept = load_swept_scene(sweep, summary.plan.best)
        except InputError as error:
            why = str(error).rstrip(".")
            raise InputError(
                "The best pose cannot be refined, because its scene cannot be rendered again: "
                f"{why}.",
                code=error.code,
                argument=error.argument,
            ) from error
        refined = refine_pose(
            sweep, summary.plan, swept, evaluations=evaluations, progress=progress
        )
    return PosePlan(summary, together, refined)
