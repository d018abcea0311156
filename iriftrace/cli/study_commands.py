"""The commands ``iriftrace study ...``: what parameters change, in accuracy or in time."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from iriftrace.cli.camera_options import Scale
from iriftrace.cli.options import Whole, numbers
from iriftrace.cli.study_inputs import StudyInputs, short_names
from iriftrace.cli.study_options import (
    Layers,
    Output,
    References,
    StudiedPart,
    StudyOptions,
    whole_numbers,
)
from iriftrace.cli.study_output import compare, measure
from iriftrace.errors import InputError

study = App(
    name="study",
    help="Show what rays, shells, triangles, smoothing and cells change, in hits or in time.\n\n"
    "Example: ``iriftrace study layers field.vtu part.ply -o layers.nc``",
)


@study.command
def layers(
    field: Path,
    part: StudiedPart,
    *,
    output: Output = Path("layers.nc"),
    layers: str = "1:20",
    reference: References = None,
    options: StudyOptions = StudyOptions(),
    scale: Scale = 0.25,
) -> None:
    """Compare numbers of shells with references.

    Example: ``iriftrace study layers field.vtu part.ply -o layers.nc --layers 1:20,40,80``

    Parameters
    ----------
    field
        Volume mesh with temperature, density or index.
    layers
        Numbers of shells, such as "1:20,40,80".
    reference
        "continuous" (the continuous engine), "linear cells" (likewise, with one gradient in each
        cell: the limit of facet normals), or a number of shells in the same mode; repeatable. By
        default 20, as in the paper, and continuous.
    """
    from iriftrace.studies.layers import CONTINUOUS, THE_PAPERS, layers_study

    counts = whole_numbers(layers, "--layers")
    modes = options.mode.modes()
    inputs = StudyInputs([field], part, output, options)
    view = inputs.view(scale)
    compare(
        layers_study(
            inputs.fields[0],
            view,
            counts,
            modes,
            reference or [str(THE_PAPERS), CONTINUOUS],
            inputs.source(view),
        ),
        output,
    )


@study.command
def smoothing(
    field: Path,
    part: StudiedPart,
    finest: Path,
    *,
    output: Output = Path("smoothing.nc"),
    iterations: str = "0,1,2,3,5,7,10,15,20,30,40,50",
    layers: Layers = 13,
    reference: References = None,
    options: StudyOptions = StudyOptions(),
    scale: Scale = 0.25,
) -> None:
    """Compare smoothed shells of a coarse field with those of a fine one, left as they are.

    Taubin smoothing with lambda 0.20 and mu -0.21. Besides the two modes, ours with facet normals.

    Example: ``iriftrace study smoothing coarse.vtu part.ply fine.vtu -o smoothing.nc``

    Parameters
    ----------
    field
        The coarse field, whose shells are smoothed.
    finest
        The fine field.
    iterations
        Smoothing iterations, such as "0,10,20:25".
    reference
        "same mode" (shells of the fine field) or "continuous" (the continuous engine on it);
        repeatable, by default both.
    """
    from iriftrace.studies.finest import SAME_MODE
    from iriftrace.studies.layers import CONTINUOUS
    from iriftrace.studies.mode import Mode
    from iriftrace.studies.smoothing import smoothing_study

    counts = whole_numbers(iterations, "--iterations")
    modes = [*options.mode.modes(), Mode("ours but facet normals", normals="facet")]
    inputs = StudyInputs([field, finest], part, output, options)
    view = inputs.view(scale)
    compare(
        smoothing_study(
            inputs.fields[0],
            inputs.fields[1],
            view,
            counts,
            modes,
            reference or [SAME_MODE, CONTINUOUS],
            inputs.source(view),
            layers=layers,
        ),
        output,
    )


@study.command
def mesh(
    field: Path,
    part: StudiedPart,
    /,
    *finer: Path,
    output: Output = Path("mesh.nc"),
    layers: Layers = 13,
    split: Annotated[list[Path] | None, Parameter(negative=())] = None,
    reference: References = None,
    options: StudyOptions = StudyOptions(),
    scale: Scale = 0.25,
) -> None:
    """Compare flow solutions of several resolutions with the finest one, at the same levels.

    Example: ``iriftrace study mesh A.vtu part.ply B.vtu C.vtu D.vtu -o mesh.nc --split B.vtu``

    Parameters
    ----------
    field
        The coarsest field.
    finer
        Finer fields, the finest last.
    split
        One of the fields that is also contoured after its cells were divided into tetrahedra, and
        after each of these was split into eight, which on linear cells only adds coplanar
        triangles; recovered gradients change, the field does not. Needs gigabytes; repeatable.
    reference
        "same mode" (shells of the finest field) or "continuous" (the continuous engine on it);
        repeatable, by default both.
    """
    from iriftrace.studies.finest import SAME_MODE
    from iriftrace.studies.layers import CONTINUOUS
    from iriftrace.studies.mesh import mesh_study

    modes = options.mode.modes()
    paths = [field, *finer]
    names = short_names(paths)
    twice = [path for path in paths if paths.count(path) > 1]
    if twice:
        raise InputError(f"{twice[0]} is given twice, so it would be compared twice; remove one.")
    for path in split or []:
        if path not in paths:
            raise InputError(f"--split {path} is none of the study's fields; name one of them.")
    inputs = StudyInputs(paths, part, output, options)
    view = inputs.view(scale)
    compare(
        mesh_study(
            dict(zip(names, inputs.fields, strict=True)),
            view,
            modes,
            reference or [SAME_MODE, CONTINUOUS],
            inputs.source(view),
            layers=layers,
            split=[names[paths.index(path)] for path in split or []],
        ),
        output,
    )


@study.command
def rays(
    field: Path,
    part: StudiedPart,
    *,
    output: Output = Path("rays.nc"),
    scales: str = "0.0625,0.125,0.25,0.5",
    layers: Layers = 13,
    options: StudyOptions = StudyOptions(),
    scale: Scale = 1.0,
) -> None:
    """Time each stage of a picture against the number of rays.

    Example: ``iriftrace study rays field.vtu part.ply -o rays.nc --scales 0.1,0.2,0.5,1``

    Parameters
    ----------
    field
        Volume mesh with temperature, density or index.
    scales
        Factors on the camera's resolution.
    """
    from iriftrace.studies.rays import rays_study

    factors = numbers(scales, scales.count(",") + 1, "--scales")
    modes = options.mode.modes()
    inputs = StudyInputs([field], part, output, options)
    view = inputs.view(scale)
    measure(
        rays_study(inputs.fields[0], view, factors, modes, inputs.source(view), layers=layers),
        output,
    )


@study.command
def polygons(
    field: Path,
    part: StudiedPart,
    *,
    output: Output = Path("polygons.nc"),
    smallest: Whole = 4_700,
    largest: Whole = 320_000,
    layers: Layers = 13,
    options: StudyOptions = StudyOptions(),
    scale: Scale = 0.25,
) -> None:
    """Time each stage of a picture against the number of triangles of each shell.

    Example: ``iriftrace study polygons field.vtu part.ply -o polygons.nc --largest 1200000``

    Parameters
    ----------
    field
        Volume mesh with temperature, density or index.
    smallest
        Triangles of each shell to begin with; larger shells are thinned out first.
    largest
        Midpoint subdivision ends before shells have more triangles; the paper's 4.8 million need
        9 GB of memory and 2 GB of disk.
    """
    from iriftrace.studies.polygons import polygons_study

    modes = options.mode.modes()
    inputs = StudyInputs([field], part, output, options)
    view = inputs.view(scale)
    measure(
        polygons_study(
            inputs.fields[0],
            view,
            modes,
            inputs.source(view),
            layers=layers,
            smallest=smallest,
            largest=largest,
        ),
        output,
    )
