"""The program ``iriftrace``: options in, files and one readable summary out."""

from __future__ import annotations

import shutil
import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, CycloptsError, Parameter
from rich.console import Console

from iriftrace.cli_errors import (
    check_folder,
    check_input,
    check_output,
    removed_on_failure,
    sentence,
)
from iriftrace.cli_options import (
    AirOptions,
    CameraOptions,
    FieldOptions,
    PartOptions,
    ShellOptions,
    Statuses,
    Variables,
    statuses,
    variables_of,
)
from iriftrace.errors import InputError, IriftraceError, IriftraceWarning

if TYPE_CHECKING:
    from iriftrace.field import IndexField
    from iriftrace.part import Part
    from iriftrace.render import Rendering
    from iriftrace.shell_stack import ShellStack

out = Console(highlight=False)
notes = Console(stderr=True, highlight=False)

app = App(
    name="iriftrace",
    help="Traces camera rays through the hot air around a part: how far does each point move?",
    version=lambda: version("iriftrace"),
    help_format="rst",
    suppress_keyboard_interrupt=False,
)

DEMO = "cylinder"


def main(arguments: list[str] | None = None) -> int:
    """Run the program; returns the exit status (0 success, 2 wrong input, 130 interrupted)."""
    with warnings.catch_warnings():
        # Ours are messages to the user, even where Python was told to make warnings errors.
        warnings.simplefilter("default", IriftraceWarning)
        warnings.showwarning = _show_warning
        try:
            app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        except (IriftraceError, CycloptsError, OSError, MemoryError) as error:
            notes.print("[bold red]error:[/] ", end="")
            notes.print(sentence(error), markup=False, soft_wrap=True)
            return 2
        except KeyboardInterrupt:
            notes.print("interrupted; nothing half written was left behind")
            return 130
    return 0


def _show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    notes.print("[bold yellow]warning:[/] ", end="")
    notes.print(str(message), markup=False, soft_wrap=True)


@contextmanager
def _working(what: str) -> Iterator[None]:
    """Show what is being done, where somebody watches."""
    with notes.status(f"{what} ..."):
        yield


@app.command
def doctor() -> int:
    """Check this machine: versions, variants, the LLVM or CUDA library, and how to mend them.

    Example: ``iriftrace doctor``
    """
    from iriftrace.doctor import diagnose

    diagnosis = diagnose()
    colours = {"ok": "green", "warn": "yellow", "error": "red"}
    for finding in diagnosis.findings:
        out.print(
            f"[{colours[finding.state]}]{finding.state:5}[/] [bold]{finding.name}[/]", end="  "
        )
        out.print(finding.text, markup=False, soft_wrap=True)
        if finding.remedy:
            out.print(f"      {finding.remedy}", markup=False, soft_wrap=True)
    if not diagnosis.ok:
        raise InputError("Something that iriftrace needs is missing; see the lines marked error.")
    return 0


@app.command
def shells(
    field: Path,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])],
    part: Path | None = None,
    air: AirOptions = AirOptions(),  # noqa: B008
    field_options: FieldOptions = FieldOptions(),  # noqa: B008
    shell_options: ShellOptions = ShellOptions(),  # noqa: B008
    part_options: PartOptions = PartOptions(),  # noqa: B008
) -> None:
    """Turn a temperature field into shells of equal refractive index.

    Writes PLY files, ``shells.vtm`` for ParaView and the table ``shells.json``.

    Example: ``iriftrace shells field.vtu -o shells/ --part part.ply --layers 13``

    Parameters
    ----------
    field
        Volume mesh with temperature, density or index (.vtu .vtk .vti .vtr .vts .pvd).
    output
        Folder for the shells.
    part
        The part's mesh; adds gaps and cuts to the table.
    """
    from iriftrace.cli_output import print_fit, print_shells
    from iriftrace.shell_io import save_shells
    from iriftrace.shell_report import report_shells

    check_input(field, part)
    check_folder(output)
    measured = None if part is None else part_options.read(part)
    stack, volume = _stack(field, air, field_options, shell_options)
    fit = None
    if measured is not None and volume is not None:
        fit = _fit(volume, measured, part_options)
    with _working("Measuring the shells"):
        reports = report_shells(stack, volume, measured)
    files = save_shells(stack, output, report=reports, notes=field_options.notes())
    print_shells(out, stack, reports, field_options.field_length_unit)
    if fit is not None:
        print_fit(out, fit)
    out.print(f"{len(files)} files in {output}", soft_wrap=True)


@app.command
def scene(
    field: Path,
    part: Path,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])],
    normals: Literal["gradient", "facet"] = "gradient",
    air: AirOptions = AirOptions(),  # noqa: B008
    field_options: FieldOptions = FieldOptions(),  # noqa: B008
    shell_options: ShellOptions = ShellOptions(),  # noqa: B008
    part_options: PartOptions = PartOptions(),  # noqa: B008
    camera_options: CameraOptions = CameraOptions(),  # noqa: B008
) -> None:
    """Make a complete scene folder of field, part and camera, which ``iriftrace render`` runs.

    Example: ``iriftrace scene field.vtu part.ply -o scene/scene.xml --origin 150,-100,160``

    Parameters
    ----------
    field
        Volume mesh with temperature, density or index.
    part
        The part's surface mesh (.ply .stl .obj .glb ...).
    output
        The scene's XML file; meshes go beside it.
    normals
        Where the shells' normals come from: the field's gradient, or their own triangles.
    """
    from iriftrace.cli_output import print_camera, print_fit, print_shells
    from iriftrace.scene import PART_FILE, write_scene
    from iriftrace.shell_report import report_shells
    from iriftrace.viewpoint import refuse_camera_inside

    check_input(field, part)
    check_output(output, ".xml", "scene.xml")
    if part.resolve() == (output.parent / PART_FILE).resolve():
        raise InputError(
            f"The scene's own {PART_FILE} would replace the part's file {part}; give the scene a "
            f"folder of its own, such as -o {output.with_suffix('') / output.name}."
        )
    measured = part_options.read(part)
    stack, volume = _stack(field, air, field_options, shell_options)
    fit = None if volume is None else _fit(volume, measured, part_options)
    camera = camera_options.camera(measured, volume, stack)
    refuse_camera_inside(camera.origin, measured, stack, volume)
    with _working("Measuring the shells"):
        reports = report_shells(stack, volume, measured)
    path = write_scene(
        output.parent,
        measured,
        stack,
        camera,
        name=output.name,
        scale=camera_options.scale,
        normals=normals,
        report=reports,
        notes=field_options.notes(),
    )
    print_shells(out, stack, reports, field_options.field_length_unit)
    if fit is not None:
        print_fit(out, fit)
    print_camera(out, camera, camera_options.scale)
    out.print(f"Scene written; now run:  iriftrace render {path}", markup=False, soft_wrap=True)


@app.command
def render(
    scene: Path,
    *,
    output: Annotated[Path | None, Parameter(name=["-o", "--output"])] = None,
    define: Variables = None,
    variant: str | None = None,
    figures: bool = True,
    include: Statuses = None,
) -> None:
    """Trace a scene: AOV EXR, metrics JSON and displacement picture.

    Example: ``iriftrace render scenes/cylinder/scene.xml -o out.exr -D scale=0.25``

    Parameters
    ----------
    scene
        The scene's XML file.
    output
        The EXR file; by default the scene's name with .exr. JSON and PNG go beside it.
    define
        Scene parameter, name=value; repeatable.
    variant
        Mitsuba variant, llvm_ad_mono or cuda_ad_mono.
    figures
        Draw the displacement picture.
    include
        Further status codes whose rays the metrics use, such as 5.
    """
    from iriftrace.cli_output import print_summary

    check_input(scene)
    exr = scene.with_suffix(".exr") if output is None else output
    check_output(exr, ".exr", "out.exr", make=False)
    used = statuses(include)
    rendering, _ = _render(scene, exr, variables_of(define), variant, used, figures)
    print_summary(out, rendering.metrics)
    _list_files(exr, figures)


@app.command
def metrics(
    image: Path,
    *,
    part: Path | None = None,
    output: Annotated[Path | None, Parameter(name=["-o", "--output"])] = None,
    include: Statuses = None,
) -> None:
    """Reduce an AOV EXR to metrics again.

    Example: ``iriftrace metrics out.exr --part part.ply``

    Parameters
    ----------
    image
        An EXR that ``iriftrace render`` wrote.
    part
        The part's mesh, where it no longer lies where the EXR says.
    output
        The JSON file; by default beside the EXR.
    include
        Further status codes whose rays the metrics use, such as 5.
    """
    from iriftrace.cli_output import print_summary
    from iriftrace.exr import read_exr
    from iriftrace.metrics import pose_metrics, write_metrics
    from iriftrace.rendered_part import part_of_image

    check_input(image, part)
    target = image.with_suffix(".json") if output is None else output
    check_output(target, ".json", "out.json", make=False)
    pixels = read_exr(image)
    shown = part_of_image(pixels, part)
    started = time.perf_counter()
    with _working("Reducing"):
        result = pose_metrics(pixels, shown, include=statuses(include))
    result["time_s"]["metrics"] = time.perf_counter() - started
    write_metrics(target, result)
    print_summary(out, result)
    out.print(f"Metrics in {target}", markup=False, soft_wrap=True)


@app.command
def demo(
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])] = Path("out"),
    define: Variables = None,
    variant: str | None = None,
) -> None:
    """Run the bundled scene of a hot cylinder, from scene to pictures and metrics.

    Example: ``iriftrace demo -o out``

    Parameters
    ----------
    output
        Folder for the results; the scene is copied there, ready to be changed.
    define
        Scene parameter, name=value; repeatable.
    variant
        Mitsuba variant, llvm_ad_mono or cuda_ad_mono.
    """
    from iriftrace.cli_output import print_summary
    from iriftrace.scenes import folder_of

    check_folder(output)
    values = variables_of(define)
    copy = output / "scene"
    _keep_edited_scene(copy / "scene.xml", folder_of(DEMO) / "scene.xml")
    exr = output / f"{DEMO}.exr"
    with removed_on_failure(copy):
        shutil.copytree(folder_of(DEMO), copy, dirs_exist_ok=True, copy_function=shutil.copyfile)
        rendering, part = _render(copy / "scene.xml", exr, values, variant, (0,), True)
    pictures = _scene_picture(rendering, part, copy / "shells", output / f"{DEMO}_scene.png")
    print_summary(out, rendering.metrics)
    _list_files(exr, True, *pictures)
    out.print(
        f"Change {copy / 'scene.xml'} and run:  iriftrace render {copy / 'scene.xml'}",
        markup=False,
        soft_wrap=True,
    )


def _keep_edited_scene(mine: Path, bundled: Path) -> None:
    """Refuse to replace a scene that somebody has changed, as the demo itself proposes."""
    if mine.is_file() and mine.read_bytes() != bundled.read_bytes():
        raise InputError(
            f"{mine} has been changed since the last demo, which would be lost; run "
            f"`iriftrace render {mine}` instead, or give another folder with -o."
        )


# By name, so that they are imported when they are called.
for _name, _help, _example in (
    (
        "sweep",
        "Render a scene from many poses into one netCDF file; resumes when interrupted.",
        "scene.xml -o sweep.nc --azimuth 0:90:10 --elevation -90:90:19",
    ),
    (
        "plan",
        "Rank the poses of a sweep by the combined metric and print the best one.",
        "sweep.nc --statistic median --region lateral",
    ),
):
    app.command(
        f"iriftrace.cli_sweep:{_name}",
        name=_name,
        help=f"{_help}\n\nExample: ``iriftrace {_name} {_example}``",
    )


def _stack(
    path: Path, air: AirOptions, field_options: FieldOptions, shell_options: ShellOptions
) -> tuple[ShellStack, IndexField | None]:
    """Shells of a volume field, or ready-made ones."""
    if field_options.isosurfaces:
        from iriftrace.shell_import import import_shells

        with _working("Reading iso-surfaces"):
            stack = import_shells(
                path,
                array=field_options.array,
                quantity=field_options.quantity,
                temperature_unit=field_options.temperature_unit,
                air=air.air(),
                length_unit=field_options.field_length_unit,
                transform=field_options.transform(),
                min_size_mm=shell_options.min_size_mm(),
            )
        return shell_options.edited(stack), None
    with _working("Reading the field"):
        volume = field_options.read(path, air.air())
    with _working("Contouring the shells"):
        return shell_options.build(volume), volume


def _fit(volume: IndexField, part: Part, options: PartOptions) -> Any:
    from iriftrace.fit import fit_part_to_field

    with _working("Comparing part and field"):
        fit = fit_part_to_field(volume, part, wall_temperature_k=options.hot_temperature_k())
    for message in fit.warnings:
        _show_warning(message, UserWarning)
    return fit


def _render(
    scene: Path,
    exr: Path,
    variables: dict[str, str],
    variant: str | None,
    include: tuple[int, ...],
    figures: bool,
) -> tuple[Rendering, Part]:
    """Render a scene and write all its files."""
    from iriftrace.render import render_scene
    from iriftrace.scene import load_scene

    with _working("Loading the scene"):
        loaded = load_scene(scene, variables, variant=variant)
    with _working("Tracing"):
        rendering = render_scene(loaded, include=include)
    if figures:
        from iriftrace.figures import displacement_figure

        with _working("Drawing"):
            started = time.perf_counter()
            displacement_figure(rendering.image, exr.with_suffix(".png"), include)
            seconds = time.perf_counter() - started
            rendering.metrics["time_s"]["figures"] = seconds
            rendering.metrics["time_s"]["total"] += seconds
    with _working("Writing"):
        rendering.save(exr)
    return rendering, loaded.part


def _scene_picture(
    rendering: Rendering, part: Part, shells_folder: Path, picture: Path
) -> list[Path]:
    """Draw part, shells and camera, where this machine can draw."""
    from iriftrace.doctor import drawing_trouble

    with _working("Drawing the scene"):
        trouble = drawing_trouble()
        if trouble:
            _show_warning(
                f"The 3-D picture is left out, because VTK cannot draw here ({trouble}); "
                "`iriftrace doctor` says how to mend it.",
                UserWarning,
            )
            return []
        from iriftrace.camera import Camera
        from iriftrace.figure_scene import scene_figure
        from iriftrace.shell_io import load_shells

        camera = Camera.from_dict(rendering.image.header["camera"])
        scene_figure(part, load_shells(shells_folder), camera, picture)
    return [picture]


def _list_files(exr: Path, figures: bool, *more: Path) -> None:
    files = [exr, exr.with_suffix(".json"), *([exr.with_suffix(".png")] if figures else []), *more]
    out.print("Files: " + ", ".join(str(file) for file in files), markup=False, soft_wrap=True)


if __name__ == "__main__":
    sys.exit(main())
