"""The commands ``iriftrace study ...``: what parameters change, in accuracy or in time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from iriftrace.cli.camera_options import CameraOptions
from iriftrace.cli.checks import check_input, check_output
from iriftrace.cli.console import out, working
from iriftrace.cli.field_options import AirOptions, FieldOptions, PartOptions
from iriftrace.cli.options import Whole, numbers
from iriftrace.cli.pose_progress import pose_progress
from iriftrace.cli.study_options import ModeOptions, whole_numbers
from iriftrace.errors import InputError

if TYPE_CHECKING:
    from iriftrace.field import IndexField
    from iriftrace.studies.pictures import View

study = App(
    name="study",
    help="Show what rays, shells, triangles, smoothing and cells change, in hits or in time.\n\n"
    "Example: ``iriftrace study layers field.vtu part.ply -o layers.nc``",
)

Output = Annotated[Path, Parameter(name=["-o", "--output"])]
References = Annotated[list[str] | None, Parameter(name="--reference", negative=())]
THE_PAPERS = ModeOptions()
QUARTER = CameraOptions(scale=0.25)
WHOLE = CameraOptions(scale=1.0)


@study.command
def layers(
    field: Path,
    part: Path,
    *,
    output: Output = Path("layers.nc"),
    layers: str = "1:20",
    reference: References = None,
    variant: str | None = None,
    mode_options: ModeOptions = THE_PAPERS,
    air: AirOptions = AirOptions(),
    field_options: FieldOptions = FieldOptions(),
    part_options: PartOptions = PartOptions(),
    camera_options: CameraOptions = QUARTER,
) -> None:
    """Compare numbers of shells with references.

    Example: ``iriftrace study layers field.vtu part.ply -o layers.nc --layers 1:20,40,80``

    Parameters
    ----------
    field
        Volume mesh with temperature, density or index.
    part
        The part's surface mesh.
    output
        The netCDF file; the figure is written beside it.
    layers
        Numbers of shells, such as "1:20,40,80".
    reference
        "continuous" (the continuous engine), "linear cells" (likewise, with one gradient in each
        cell: the limit of facet normals), or a number of shells in the same mode; repeatable. By
        default 20, as in the paper, and continuous.
    variant
        Mitsuba variant, llvm_ad_mono or cuda_ad_mono.
    """
    from iriftrace.studies.layers import CONTINUOUS, THE_PAPERS, layers_study

    counts = whole_numbers(layers, "--layers")
    modes = mode_options.modes()
    inputs = _Inputs([field], part, output, air, field_options, part_options, variant)
    view = inputs.view(camera_options)
    _compare(
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
    part: Path,
    finest: Path,
    *,
    output: Output = Path("smoothing.nc"),
    iterations: str = "0,1,2,3,5,7,10,15,20,30,40,50",
    layers: Whole = 13,
    reference: References = None,
    variant: str | None = None,
    mode_options: ModeOptions = THE_PAPERS,
    air: AirOptions = AirOptions(),
    field_options: FieldOptions = FieldOptions(),
    part_options: PartOptions = PartOptions(),
    camera_options: CameraOptions = QUARTER,
) -> None:
    """Compare smoothed shells of a coarse field with those of a fine one, left as they are.

    Taubin smoothing with lambda 0.20 and mu -0.21. Besides the two modes, ours with facet normals.

    Example: ``iriftrace study smoothing coarse.vtu part.ply fine.vtu -o smoothing.nc``

    Parameters
    ----------
    field
        The coarse field, whose shells are smoothed.
    part
        The part's surface mesh.
    finest
        The fine field.
    output
        The netCDF file; the figure is written beside it.
    iterations
        Smoothing iterations, such as "0,10,20:25".
    layers
        Number of shells.
    reference
        "same mode" (shells of the fine field) or "continuous" (the continuous engine on it);
        repeatable, by default both.
    variant
        Mitsuba variant, llvm_ad_mono or cuda_ad_mono.
    """
    from iriftrace.studies.finest import SAME_MODE
    from iriftrace.studies.layers import CONTINUOUS
    from iriftrace.studies.mode import Mode
    from iriftrace.studies.smoothing import smoothing_study

    counts = whole_numbers(iterations, "--iterations")
    modes = [*mode_options.modes(), Mode("ours but facet normals", normals="facet")]
    inputs = _Inputs([field, finest], part, output, air, field_options, part_options, variant)
    view = inputs.view(camera_options)
    _compare(
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
    part: Path,
    /,
    *finer: Path,
    output: Output = Path("mesh.nc"),
    layers: Whole = 13,
    split: Annotated[list[Path] | None, Parameter(negative=())] = None,
    reference: References = None,
    variant: str | None = None,
    mode_options: ModeOptions = THE_PAPERS,
    air: AirOptions = AirOptions(),
    field_options: FieldOptions = FieldOptions(),
    part_options: PartOptions = PartOptions(),
    camera_options: CameraOptions = QUARTER,
) -> None:
    """Compare flow solutions of several resolutions with the finest one, at the same levels.

    Example: ``iriftrace study mesh A.vtu part.ply B.vtu C.vtu D.vtu -o mesh.nc --split B.vtu``

    Parameters
    ----------
    field
        The coarsest field.
    part
        The part's surface mesh.
    finer
        Finer fields, the finest last.
    output
        The netCDF file; the figure is written beside it.
    layers
        Number of shells.
    split
        One of the fields that is also contoured after its cells were divided into tetrahedra, and
        after each of these was split into eight. Needs gigabytes; repeatable.
    reference
        "same mode" (shells of the finest field) or "continuous" (the continuous engine on it);
        repeatable, by default both.
    variant
        Mitsuba variant, llvm_ad_mono or cuda_ad_mono.
    """
    from iriftrace.studies.finest import SAME_MODE
    from iriftrace.studies.layers import CONTINUOUS
    from iriftrace.studies.mesh import mesh_study

    modes = mode_options.modes()
    paths = [field, *finer]
    names = _names(paths)
    twice = [path for path in paths if paths.count(path) > 1]
    if twice:
        raise InputError(f"{twice[0]} is given twice, so it would be compared twice; remove one.")
    for path in split or []:
        if path not in paths:
            raise InputError(f"--split {path} is none of the study's fields; name one of them.")
    inputs = _Inputs(paths, part, output, air, field_options, part_options, variant)
    view = inputs.view(camera_options)
    _compare(
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
    part: Path,
    *,
    output: Output = Path("rays.nc"),
    scales: str = "0.0625,0.125,0.25,0.5",
    layers: Whole = 13,
    variant: str | None = None,
    mode_options: ModeOptions = THE_PAPERS,
    air: AirOptions = AirOptions(),
    field_options: FieldOptions = FieldOptions(),
    part_options: PartOptions = PartOptions(),
    camera_options: CameraOptions = WHOLE,
) -> None:
    """Time each stage of a picture against the number of rays.

    Example: ``iriftrace study rays field.vtu part.ply -o rays.nc --scales 0.1,0.2,0.5,1``

    Parameters
    ----------
    field
        Volume mesh with temperature, density or index.
    part
        The part's surface mesh.
    output
        The netCDF file; the figure is written beside it.
    scales
        Factors on the camera's resolution.
    layers
        Number of shells.
    variant
        Mitsuba variant, llvm_ad_mono or cuda_ad_mono.
    """
    from iriftrace.studies.rays import rays_study

    factors = numbers(scales, scales.count(",") + 1, "--scales")
    modes = mode_options.modes()
    inputs = _Inputs([field], part, output, air, field_options, part_options, variant)
    view = inputs.view(camera_options)
    _time(
        rays_study(inputs.fields[0], view, factors, modes, inputs.source(view), layers=layers),
        output,
    )


@study.command
def polygons(
    field: Path,
    part: Path,
    *,
    output: Output = Path("polygons.nc"),
    smallest: Whole = 4_700,
    largest: Whole = 320_000,
    layers: Whole = 13,
    variant: str | None = None,
    mode_options: ModeOptions = THE_PAPERS,
    air: AirOptions = AirOptions(),
    field_options: FieldOptions = FieldOptions(),
    part_options: PartOptions = PartOptions(),
    camera_options: CameraOptions = QUARTER,
) -> None:
    """Time each stage of a picture against the number of triangles of each shell.

    Example: ``iriftrace study polygons field.vtu part.ply -o polygons.nc --largest 1200000``

    Parameters
    ----------
    field
        Volume mesh with temperature, density or index.
    part
        The part's surface mesh.
    output
        The netCDF file; the figure is written beside it.
    smallest
        Triangles of each shell to begin with; larger shells are thinned out first.
    largest
        Midpoint subdivision ends before shells have more triangles; the paper's 4.8 million need
        8 GB of memory.
    layers
        Number of shells.
    variant
        Mitsuba variant, llvm_ad_mono or cuda_ad_mono.
    """
    from iriftrace.studies.polygons import polygons_study

    modes = mode_options.modes()
    inputs = _Inputs([field], part, output, air, field_options, part_options, variant)
    view = inputs.view(camera_options)
    _time(
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


class _Inputs:
    """Fields and part of a study, read after every option was looked at."""

    def __init__(
        self,
        fields: Sequence[Path],
        part: Path,
        output: Path,
        air: AirOptions,
        field_options: FieldOptions,
        part_options: PartOptions,
        variant: str | None,
    ) -> None:
        from iriftrace import runtime

        check_input(*fields, part)
        check_output(output, ".nc", "study.nc", make=False)
        if field_options.isosurfaces:
            raise InputError(
                "A study contours the field anew for each case, so it needs the volume field and "
                "no ready-made iso-surfaces."
            )
        self.variant = runtime.ensure(variant)
        self.part = part_options.read(part)
        self.notes = field_options.notes()
        with working("Reading the field" if len(fields) == 1 else "Reading the fields"):
            self.fields: list[IndexField] = [field_options.read(path, air.air()) for path in fields]

    def view(self, options: CameraOptions) -> View:
        """The camera at its traced resolution, with part and variant."""
        from iriftrace.shells import contour_shells
        from iriftrace.studies.pictures import View
        from iriftrace.viewpoint import refuse_camera_inside

        finest = self.fields[-1]
        stack = contour_shells(finest, 1)
        camera = options.camera(self.part, finest, stack)
        refuse_camera_inside(camera.origin, self.part, stack, finest)
        return View(self.part, camera.scaled(options.scale), self.variant)

    def source(self, view: View) -> dict[str, Any]:
        """Where the study comes from, as plain JSON values."""
        from importlib.metadata import version

        from attrs import asdict

        return {
            "version": version("iriftrace"),
            "fields": [asdict(field.source) for field in self.fields],
            "part": {"path": str(self.part.path), "sha256": self.part.sha256},
            "air": asdict(self.fields[0].air),
            "camera": view.camera.as_dict(),
            "notes": self.notes,
            "variant": view.variant,
            "length_unit": "mm",
        }


def _names(paths: Sequence[Path]) -> list[str]:
    """Short names of files: their stems where these differ."""
    stems = [path.stem for path in paths]
    return stems if len(set(stems)) == len(stems) else [str(path) for path in paths]


def _compare(comparison: Any, output: Path) -> None:
    from iriftrace.cli.study_output import print_comparison
    from iriftrace.studies.comparison import run_comparison

    _run(run_comparison, comparison, output, print_comparison)


def _time(timing: Any, output: Path) -> None:
    from iriftrace.cli.study_output import print_timing
    from iriftrace.studies.timing import run_timing

    _run(run_timing, timing, output, print_timing)


def _run(
    run: Callable[..., Any],
    what: Any,
    output: Path,
    show: Callable[[Any, Any], None],
) -> None:
    from iriftrace.figure_file import write_png
    from iriftrace.studies.figure import study_figure

    with pose_progress("Cases") as report:
        dataset = run(what, output, report)
    show(out, dataset)
    picture = output.with_suffix(".png")
    with working("Drawing"):
        write_png(study_figure(dataset), picture)
    out.print(f"Study in {output}, figure in {picture}", markup=False, soft_wrap=True)
