"""The studies of Kern et al. (2025): ``python -m validation.paper STUDY FIELD PART [OPTIONS]``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

from attrs import evolve, frozen
from cyclopts import App, CycloptsError, Group, Parameter

from iriftrace.cli import checks
from iriftrace.cli.console import pose_progress, say, working, written_figure
from iriftrace.cli.options import Flag, Output, Whole
from iriftrace.cli.reading import (
    AirOptions,
    CameraDescription,
    FieldReading,
    PartReading,
    Scale,
    read_part,
)
from iriftrace.core.errors import InputError, IriftraceError
from iriftrace.core.number_lists import Numbers
from iriftrace.core.runtime import variant
from iriftrace.io.field import read_field
from iriftrace.io.reading import AS_DRAWN, FIELD_AS_STATED
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.shells.options import Rule
from iriftrace.tracing.camera_options import USUAL_CAMERA
from iriftrace.tracing.hot_air import HotAir
from iriftrace.tracing.scene import Scene
from iriftrace.tracing.viewpoint import refuse_camera_inside
from validation.paper.figures import study_figure
from validation.paper.kinds import (
    layers_study,
    mesh_study,
    polygons_study,
    rays_study,
    smoothing_study,
)
from validation.paper.mode import OURS, PAPERS, Mode, one_change_each
from validation.paper.study import Setup, Study, run_study
from validation.paper.tables import print_comparison, print_timing

StudiedField = Annotated[Path, Parameter(help="Volume mesh with temperature, density or index.")]
StudiedPart = Annotated[Path, Parameter(help="The part's surface mesh.")]
StudyFile = Annotated[Output, Parameter(help="The netCDF file; the figure is written next to it.")]
References = Annotated[list[str] | None, Parameter(name="--reference")]
Layers = Annotated[Whole, Parameter(help="Number of shells.")]

MODE = Group("Second mode, compared with ours (gradient, rim, refract, 0)", sort_key=0)


@Parameter(name="*", group=MODE)
@frozen
class ModeOptions:
    """Shells and refraction of the second mode; by default the paper's.

    Parameters
    ----------
    normals
        Normals at which rays are refracted.
    index_rule
        Position of shells between the layers that they separate, as ``--rule`` of ``iriftrace
        scene``; or outer, at the outer one's end.
    inside_hit
        Treatment of rays that meet a shell from its inside: refracted, or dropped.
    drop_inner
        Number of innermost shells to leave out; one number, or one for each field, "3,3,0,0".
    explain
        Also the second mode with one of its choices at a time replaced by ours.
    """

    normals: Literal["gradient", "facet"] = "facet"
    index_rule: Rule = "outer"
    inside_hit: Literal["refract", "drop"] = "drop"
    drop_inner: str = "0"
    explain: Flag = False

    def modes(self) -> list[Mode]:
        """Ours, the second one, and those between them if requested."""
        second = evolve(
            PAPERS,
            normals=self.normals,
            index_rule=self.index_rule,
            inside_hit=self.inside_hit,
            drop_inner=whole_numbers(self.drop_inner, "--drop-inner"),
        )
        choices = ("normals", "index_rule", "inside_hit")
        if any(getattr(second, name) != getattr(PAPERS, name) for name in choices):
            second = evolve(second, name="other")
        return [OURS, second, *(one_change_each(second) if self.explain else [])]


@Parameter(name="*")
@frozen
class StudyOptions:
    """Reading of fields and part, and tracing.

    Parameters
    ----------
    variant
        Mitsuba variant, llvm_ad_mono or cuda_ad_mono.
    """

    variant: str | None = None
    mode: ModeOptions = ModeOptions()
    air: AirOptions = Air()
    field: FieldReading = FIELD_AS_STATED
    part: PartReading = AS_DRAWN
    camera: CameraDescription = USUAL_CAMERA


def whole_numbers(text: str, option: str) -> list[int]:
    """Whole numbers of a list such as "1:20,40,80", in which 1:20 stands for 1, 2 ... 20."""
    values: list[int] = []
    for piece in text.split(","):
        first, colon, last = piece.partition(":")
        if not first.strip().isdecimal() or (colon and not last.strip().isdecimal()):
            raise InputError(
                f'{option} is "{text}"; give whole numbers separated by commas, or a range such as '
                "1:20.",
                code="validation.no_numbers",
            )
        start, stop = int(first), int(last if colon else first)
        if stop < start or stop - start > 10_000:
            raise InputError(
                f'{option} is "{text}", but the range {piece.strip()} does not rise, or is too '
                "long; write it as FIRST:LAST.",
                code="validation.no_range",
            )
        values += range(start, stop + 1)
    return values


def _run(
    fields: Sequence[Path],
    part: Path,
    output: Path,
    options: StudyOptions,
    scale: float,
    describe: Callable[[Setup], Study],
    *more: Mode,
) -> None:
    """Run a study behind a progress bar, print its tables and draw its figure."""
    modes = [*options.mode.modes(), *more]
    if options.field.isosurfaces:
        raise InputError(
            "A study contours the field again for each case, so it needs the volume field and "
            "not ready-made iso-surfaces.",
            code="validation.isosurfaces",
        )
    checks.order(fields[0], part)
    checks.fields(*fields)
    checks.inputs(part)
    checks.output(output, "study.nc")
    traced_by = variant.ensure(options.variant)
    mesh = read_part(part, options.part)
    with working("Reading the field" if len(fields) == 1 else "Reading the fields"):
        volumes = [read_field(path, options.field, air=options.air, part=mesh) for path in fields]
    air = HotAir(volumes[-1], layers=1, notes=options.field.notes)
    stack = air.states[0].shells
    camera = options.camera.camera(mesh, volumes[-1], stack)
    refuse_camera_inside(camera.origin, (mesh,), air.states[0])
    scene = Scene(mesh, air, camera.scaled(scale), variant=traced_by)
    described = describe(Setup(scene, dict(zip(names_of(fields), volumes, strict=True)), modes))
    with pose_progress(output, "Cases") as report:
        dataset = run_study(described, output, report)
    (print_comparison if described.references else print_timing)(dataset)
    picture = written_figure(lambda: study_figure(dataset), output.with_suffix(".png"))
    say(f"Study in {output}, figure in {picture}")


def names_of(fields: Sequence[Path]) -> list[str]:
    """Names of fields: those of their files, with folders or numbers if these are the same."""
    numbered = [f"{number}: {path}" for number, path in enumerate(fields, start=1)]
    names = [path.stem for path in fields], [str(path) for path in fields], numbered
    return next(each for each in names if len(set(each)) == len(each))


study = App(
    name="python -m validation.paper",
    help="Show what rays, shells, triangles, smoothing and cells change, in hits or in time.\n\n"
    "Example: ``python -m validation.paper layers field.vtu part.ply -o layers.nc``",
    help_format="rst",
    default_parameter=Parameter(negative_iterable=()),
)


def main(words: list[str] | None = None) -> int:
    """Run a study; returns the exit status, 2 for wrong input."""
    try:
        study(words, exit_on_error=False, print_error=False, result_action="return_value")
    except (IriftraceError, CycloptsError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


@study.command
def layers(
    field: StudiedField,
    part: StudiedPart,
    *,
    output: StudyFile = Path("layers.nc"),
    layers: str = "1:20",
    reference: References = None,
    options: StudyOptions = StudyOptions(),
    scale: Scale = 0.25,
) -> None:
    """Compare numbers of shells with references.

    Example: ``python -m validation.paper layers field.vtu part.ply --layers 1:20,40,80``

    Parameters
    ----------
    layers
        Numbers of shells, such as "1:20,40,80".
    reference
        "cells" (the cells engine), "linear cells" (likewise, with one gradient in each
        cell: the limit of facet normals), or a number of shells of the finest field in the same
        mode; repeatable. By default 20, as in the paper, and cells.
    """
    counts = whole_numbers(layers, "--layers")
    made = partial(layers_study, layers=counts, references=reference)
    _run([field], part, output, options, scale, made)


@study.command
def smoothing(
    field: Path,
    part: StudiedPart,
    finest: Path,
    *,
    output: StudyFile = Path("smoothing.nc"),
    iterations: str = "0,1,2,3,5,7,10,15,20,30,40,50",
    layers: Layers = 13,
    reference: References = None,
    options: StudyOptions = StudyOptions(),
    scale: Scale = 0.25,
) -> None:
    """Compare smoothed shells of a coarse field with unsmoothed shells of a fine one.

    Taubin smoothing with lambda 0.20 and mu -0.21. Our mode is also compared with facet normals.

    Example: ``python -m validation.paper smoothing coarse.vtu part.ply fine.vtu -o smoothing.nc``

    Parameters
    ----------
    field
        The coarse field, whose shells are smoothed.
    finest
        The fine field.
    iterations
        Smoothing iterations, such as "0,10,20:25".
    reference
        "same mode" (shells of the fine field) or "cells" (the cells engine on it);
        repeatable, by default both.
    """
    counts = whole_numbers(iterations, "--iterations")
    made = partial(smoothing_study, iterations=counts, layers=layers, references=reference)
    facets = Mode("ours but facet normals", normals="facet")
    _run([field, finest], part, output, options, scale, made, facets)


@study.command
def mesh(
    field: Path,
    part: StudiedPart,
    /,
    *finer: Path,
    output: StudyFile = Path("mesh.nc"),
    layers: Layers = 13,
    split: list[Path] | None = None,
    reference: References = None,
    options: StudyOptions = StudyOptions(),
    scale: Scale = 0.25,
) -> None:
    """Compare flow solutions of several resolutions with the finest one, at the same levels.

    Example: ``python -m validation.paper mesh A.vtu part.ply B.vtu C.vtu D.vtu --split B.vtu``

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
        "same mode" (shells of the finest field) or "cells" (the cells engine on it);
        repeatable, by default both.
    """
    paths = [field, *finer]
    twice = [path for path in paths if paths.count(path) > 1]
    if twice:
        raise InputError(
            f"{twice[0]} is given twice, so it would be compared twice; remove one.",
            code="validation.not_each_once",
        )
    for path in split or []:
        if path not in paths:
            raise InputError(
                f"--split {path} is not one of the study's fields; name one of them.",
                code="validation.unknown_field",
            )
    cut = [names_of(paths)[paths.index(path)] for path in split or []]
    made = partial(mesh_study, layers=layers, split=cut, references=reference)
    _run(paths, part, output, options, scale, made)


@study.command
def rays(
    field: StudiedField,
    part: StudiedPart,
    *,
    output: StudyFile = Path("rays.nc"),
    scales: Numbers = (0.0625, 0.125, 0.25, 0.5),
    layers: Layers = 13,
    options: StudyOptions = StudyOptions(),
    scale: Scale = 1.0,
) -> None:
    """Time each stage of a picture against the number of rays.

    Example: ``python -m validation.paper rays field.vtu part.ply --scales 0.1,0.2,0.5,1``

    Parameters
    ----------
    scales
        Factors on the camera's resolution.
    """
    made = partial(rays_study, scales=scales, layers=layers)
    _run([field], part, output, options, scale, made)


@study.command
def polygons(
    field: StudiedField,
    part: StudiedPart,
    *,
    output: StudyFile = Path("polygons.nc"),
    smallest: Whole = 4_700,
    largest: Whole = 320_000,
    layers: Layers = 13,
    options: StudyOptions = StudyOptions(),
    scale: Scale = 0.25,
) -> None:
    """Time each stage of a picture against the number of triangles of each shell.

    Example: ``python -m validation.paper polygons field.vtu part.ply --largest 1200000``

    Parameters
    ----------
    smallest
        Mean number of triangles of a shell to begin with; shells with more are reduced first.
    largest
        Midpoint subdivision ends before shells have more triangles; the paper's 4.8 million need
        over 9 GB of memory.
    """
    made = partial(polygons_study, layers=layers, smallest=smallest, largest=largest)
    _run([field], part, output, options, scale, made)


if __name__ == "__main__":
    sys.exit(main())
