"""The command ``iriftrace plan``: the best camera poses of a sweep."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from cyclopts import Group, Parameter

from iriftrace.cli import checks
from iriftrace.cli.console import say, working
from iriftrace.cli.groups import group
from iriftrace.cli.options import Flag, LightOf, Whole
from iriftrace.cli.trace_options import check_light
from iriftrace.core.errors import InputError, refuse_given
from iriftrace.io.poses import OPENCV, Convention
from iriftrace.planning.criteria import (
    SHOWN,
    STANDARD_CRITERIA,
    USUAL_PAIRING,
    Criteria,
    Pairing,
    Views,
)

Ranking = Annotated[Criteria, group(Criteria, "Ranking", 1)]
"""Options of the ranking of poses: the same for plan, plot and report."""

REFINE = Group("Refinement", sort_key=3)
PAIRS = Group("Two devices", sort_key=5)
POSES = Group("Poses for other programs", sort_key=4)


Several = Annotated[Views | None, group(Views, "Several views", 2, show_default=False)]
InPairs = Annotated[Pairing | None, group(Pairing, "Two devices", 5, show_default=False)]


def plan(
    sweep: Path,
    *,
    ranking: Ranking = STANDARD_CRITERIA,
    top: Whole = SHOWN,
    uncertainty: str = "",
    wavelength: LightOf = None,
    views: Several = None,
    refine: Annotated[Flag, Parameter(group=REFINE)] = False,
    evaluations: Annotated[Whole | None, Parameter(group=REFINE)] = None,
    output: Annotated[Path | None, Parameter(name=["-o", "--output"], group=REFINE)] = None,
    pairs: Annotated[Flag, Parameter(group=PAIRS)] = False,
    pairing: InPairs = None,
    save: Annotated[Path | None, Parameter(group=POSES)] = None,
    convention: Annotated[Convention | None, Parameter(group=POSES)] = None,
) -> None:
    """Rank the poses of a sweep by the combined metric and print the best one.

    With --criterion, rank by one error alone. With --views, also find the set of poses that
    together see the most of the part; with --refine, also the best pose near the best one of the
    sweep.

    Example: ``iriftrace plan sweep.nc --statistic median --region lateral``

    Parameters
    ----------
    sweep
        A file that ``iriftrace sweep`` wrote.
    top
        Number of rows of the ranking to print.
    uncertainty
        Standard uncertainties of what scales the error, "air 5 %, mesh 2 %, numerics 1 %": names
        the poses that do not differ from the best by more than its U.
    refine
        Search around the best pose or pair, with position, distance and roll free; needs the
        scene's files.
    evaluations
        Maximum number of poses that the search renders, or pairs that it measures, 80 by default.
    output
        Write the refined pose or pair to this .json file.
    pairs
        Rank pairs of poses for two devices, such as a camera and a projector, by their predicted
        error, the area that both see, and the angle between them; the best three are
        measured (``iriftrace measure``), unless --no-confirm is given.
    save
        Write the chosen poses to this .json, .csv or .npy file, which scene and sweep read: the
        refined pose, the poses of --views, or those of the printed ranking, best first. A .json
        also states the distance in focus of each, and the motion between two devices.
    convention
        Camera axes in that file, opencv (x right, y down, z forward) by default.
    """
    from iriftrace.cli import plan_text
    from iriftrace.measuring.uncertainty.inputs import Inputs
    from iriftrace.planning.chosen import write_chosen
    from iriftrace.planning.pose_plan import plan as plan_poses
    from iriftrace.planning.refine import EVALUATIONS, check_evaluations, write_refined
    from iriftrace.planning.texts import indistinct_text, ranking_table
    from iriftrace.sweep.store import read_sweep

    _refuse_without("--save", save is not None, {"convention": convention})
    _refuse_without("--refine", refine, {"evaluations": evaluations, "output": output})
    if pairing is not None and not pairs:
        raise InputError(
            "An option for two devices is given without --pairs, so it changes nothing; add it.",
            code="options.not_together",
        )
    checks.output(output, "refined.json")
    count = EVALUATIONS if evaluations is None else evaluations
    if refine:
        check_evaluations(count)
    if pairs:
        refuse_given(
            {"views": views, "save": save, "uncertainty": uncertainty or None},
            "is about single poses; leave it out, or --pairs.",
            "options.not_together",
        )
    checks.inputs(sweep)
    inputs = Inputs.of(uncertainty)
    dataset = read_sweep(sweep)
    check_light(wavelength, dataset.attrs, sweep)
    if pairs:
        from iriftrace.planning.pairs import plan_pairs
        from iriftrace.planning.refine import refine_pair, write_refined_pair

        with working("Ranking pairs of poses"):
            paired = plan_pairs(dataset, ranking, pairing or USUAL_PAIRING)
        plan_text.print_pairs(dataset, paired, top)
        if refine:
            with plan_text.search_progress(count) as progress:
                better = refine_pair(dataset, paired, evaluations=count, progress=progress)
            plan_text.print_refined_pair(paired, better)
            if output is not None:
                write_refined_pair(output, better, paired, dataset)
                say(f"Refined pair in {output}")
        return
    with plan_text.search_progress(count) as progress:
        found = plan_poses(
            dataset,
            ranking,
            views=views,
            evaluations=count if refine else None,
            progress=progress,
        )
    summary = found.summary
    table = ranking_table(summary, top)
    indistinct = indistinct_text(summary, inputs)
    if save is not None:
        checks.parent(save)
        write_chosen(save, found, top, convention or OPENCV)
    # All errors have been raised by now, so that nothing is printed in vain.
    plan_text.print_plan(summary, table, indistinct)
    if views is not None and found.views is not None:
        plan_text.print_views(summary, found.views, views)
    if found.refined is not None:
        plan_text.print_refined(summary, found.refined)
        if output is not None:
            write_refined(output, found.refined, summary.plan, dataset)
            say(f"Refined pose in {output}")
    if save is not None:
        say(f"Chosen poses in {save}")


def _refuse_without(needed: str, there: bool, options: Mapping[str, object]) -> None:
    if not there:
        reason = f"is given without {needed}, so it changes nothing; add it."
        refuse_given(options, reason, "options.not_together")
