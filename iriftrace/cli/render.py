"""The commands ``iriftrace render``, ``metrics`` and ``demo``: from a scene to results."""

from __future__ import annotations

import json
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from attrs import evolve

from iriftrace.cli import checks
from iriftrace.cli.aperture_options import Aperture, effects_of, say_effects
from iriftrace.cli.console import command_line, say, working
from iriftrace.cli.options import LightOf, Output
from iriftrace.cli.ray import write_rays
from iriftrace.cli.trace_options import Statuses, Tracing, check_light, load, statuses
from iriftrace.core.errors import warn
from iriftrace.tracing.options import PINHOLE, TRACE_AS_STATED

if TYPE_CHECKING:
    from iriftrace.core.plain import JsonObject
    from iriftrace.tracing.render import Rendering
    from iriftrace.tracing.scene import Scene


DEMO = "cylinder"


def render(
    scene: Path,
    *,
    output: Output | None = None,
    trace: Tracing = TRACE_AS_STATED,
    figures: bool = True,
    surface: Path | None = None,
    rgb: Literal["displacement", "shift", "refracted"] | None = None,
    include: Statuses = None,
    uncertainty: str | None = None,
    lens: Aperture = PINHOLE,
) -> None:
    """Trace a scene: AOV EXR, metrics JSON and displacement picture.

    All members of an ensemble (a scene with several fields) are traced: the mean displacement is
    the bias, the standard deviation the scatter, and there is a picture of each. ``-D member=3``
    traces only the third one.

    Example: ``iriftrace render scenes/cylinder/scene.xml -o out.exr -D scale=0.25``

    Parameters
    ----------
    scene
        The scene's XML file.
    output
        The EXR file; by default the scene's name with .exr. JSON and PNG are written next to it.
    figures
        Draw the displacement picture.
    surface
        Write the hits on the part with their displacement too, as points for ParaView (.vtp) or
        CloudCompare (.ply).
    rgb
        Repeat these channels of the EXR as R, G and B, for programs that show no others.
    uncertainty
        Also write the standard uncertainty of each pixel's displacement (displacement.u.norm), by
        the members and by these of the inputs, "air 5 %, wall 10 K", as for ``iriftrace budget``.
    """
    from iriftrace.io.lost_rays import rays_file_of
    from iriftrace.io.surface import write_surface

    # Before the output, whose folder is the scene's unless another one is given.
    checks.scenes(scene)
    exr = scene.with_suffix(".exr") if output is None else output
    checks.output(exr, "out.exr")
    checks.numbers(exr, "iriftrace.pose")
    checks.numbers(rays_file_of(exr), "iriftrace.rays")
    checks.output(surface, "out.vtp", ".ply")
    used = statuses(include)
    loaded = load(scene, trace)
    checks.kept(surface, loaded.part.path)
    effects = effects_of(lens, loaded, {"camera": loaded.camera})
    rendering, files = _render(
        loaded, exr, used, figures, rgb, aperture=effects.get("camera"), uncertainty=uncertainty
    )
    if surface is not None:
        write_surface(surface, rendering.image, loaded.part)
        files.append(surface)
    say_effects(effects)
    _print_rendering(rendering, loaded, files)


def metrics(
    image: Path,
    *,
    part: Path | None = None,
    output: Output | None = None,
    include: Statuses = None,
    wavelength: LightOf = None,
) -> None:
    """Reduce an AOV EXR to metrics again.

    Example: ``iriftrace metrics out.exr --part part.ply``

    Parameters
    ----------
    image
        An EXR that ``iriftrace render`` wrote.
    part
        The part's mesh, if it is no longer where the EXR states.
    output
        The JSON file; by default next to the EXR.
    """
    from iriftrace.cli.output import print_summary
    from iriftrace.image.metrics import pose_metrics, write_metrics
    from iriftrace.io.exr import read_exr, read_part_of
    from iriftrace.tracing.render import keep_checks

    checks.inputs(image, part)
    target = image.with_suffix(".json") if output is None else output
    checks.output(target, "out.json")
    pixels = read_exr(image)
    checks.numbers(target, "iriftrace.pose")
    check_light(wavelength, pixels.header, image)
    shown = read_part_of(pixels, part)
    started = time.perf_counter()
    with working("Reducing"):
        result = pose_metrics(pixels, shown, include=statuses(include))
    result = evolve(result, time_s={**result.time_s, "metrics": time.perf_counter() - started})
    with suppress(OSError, ValueError, AttributeError):
        # There may be no report of this image yet.
        result = keep_checks(result, json.loads(target.read_text(encoding="utf-8")))
    write_metrics(target, result)
    print_summary(result)
    say(f"Metrics in {target}")


def demo(
    *,
    output: Output = Path("out"),
    scene: str = DEMO,
    trace: Tracing = TRACE_AS_STATED,
) -> None:
    """Run a bundled scene, by default a hot cylinder, from scene to pictures and metrics.

    Example: ``iriftrace demo -o out --scene bevel_gear``

    Parameters
    ----------
    output
        Folder for the results; the scene is copied there and may be edited.
    scene
        Name of the bundled scene: bevel_gear, concentric_cylinders, cylinder, cylinder_paper,
        fringe_cylinder, gear_tooth, hot_plate, hybrid_cylinder, slab or wishbone.
    """
    from iriftrace.scenes import scene_copied

    checks.folder(output)
    # Wrong names are refused before anything is copied.
    trace.variables()
    exr = output / f"{scene}.exr"
    folder = output / ("scene" if scene == DEMO else scene)
    with scene_copied(scene, folder) as (xml, shells):
        loaded = load(xml, trace)
        rendering, files = _render(loaded, exr, statuses(None))
    files += _scene_pictures(loaded, shells, output / f"{scene}_scene.png")
    _print_rendering(rendering, loaded, files)
    if loaded.second is not None:
        from iriftrace.cli.measure import write_scan

        write_scan(loaded, output / f"{scene}_scan.vtp")
    say(f"Change {xml} and run:  {command_line('render', xml)}")


def _render(
    loaded: Scene,
    exr: Path,
    include: tuple[int, ...],
    figures: bool = True,
    rgb: str | None = None,
    *,
    aperture: JsonObject | None = None,
    uncertainty: str | None = None,
) -> tuple[Rendering, list[Path]]:
    """Render a scene and write all its files except that of the surface."""
    from iriftrace.image.lost_rays import lost_rays_of
    from iriftrace.tracing.render import render_scene

    if uncertainty is None:
        with working("Tracing"):
            rendering = render_scene(loaded, include=include)
    else:
        rendering = _with_uncertainty(loaded, include, uncertainty)
    rendering = evolve(rendering, metrics=evolve(rendering.metrics, aperture=aperture))
    # Before the picture, which cannot be drawn if all rays are lost.
    rays = write_rays(exr, lost_rays_of(rendering.image))
    pictures = []
    if figures:
        from iriftrace.figures.pose import pose_figures
        from iriftrace.figures.style import write_figure

        with working("Drawing"):
            started = time.perf_counter()
            for name, figure in pose_figures(rendering.image, exr.stem, include).items():
                pictures.append(exr.with_name(f"{name}.png"))
                write_figure(figure, pictures[-1])
            rendering = rendering.with_time("figures", started)
    with working("Writing"):
        return rendering.saved(exr, rgb=rgb), [exr, exr.with_suffix(".json"), *pictures, *rays]


def _with_uncertainty(loaded: Scene, include: tuple[int, ...], uncertainty: str) -> Rendering:
    from iriftrace.cli.answer import say_pose
    from iriftrace.measuring.uncertainty.displacement import render_with_uncertainty
    from iriftrace.measuring.uncertainty.inputs import Inputs

    inputs = Inputs.of(uncertainty)
    with working("Tracing"):
        found = render_with_uncertainty(loaded, inputs, include=include)
    say_pose(found)
    return found.rendering


def _print_rendering(rendering: Rendering, loaded: Scene, files: list[Path]) -> None:
    from iriftrace.cli.output import print_summary, print_view

    print_summary(rendering.metrics)
    move, refocus = "move the camera", "change focus_near and focus_far"
    print_view(loaded.part, rendering.image.camera, move, refocus, " in the scene's file")
    say("Files: " + ", ".join(map(str, files)))


def _scene_pictures(scene: Scene, shells_folder: Path, picture: Path) -> list[Path]:
    """Draw part, shells and devices, and bent rays, if this machine can draw."""
    from iriftrace.core.runtime.doctor import drawing_trouble

    with working("Drawing the scene"):
        trouble = drawing_trouble()
        if trouble:
            warn(
                f"The 3-D picture is left out, because VTK cannot draw here ({trouble}); "
                "`iriftrace doctor` shows how to repair it."
            )
            return []
        from iriftrace.figures.scene import rays_figure, scene_figure
        from iriftrace.figures.style import write_figure
        from iriftrace.io.shells import load_shells

        shells, name = load_shells(shells_folder), scene.second_id.replace("_", " ")
        figure = scene_figure(scene.part, shells, scene.camera, scene.second, name)
        write_figure(figure, picture)
        rays = picture.with_stem(picture.stem.replace("_scene", "_rays"))
        write_figure(rays_figure(scene), rays)
    return [picture, rays]
