"""The command ``iriftrace ray``, and the files of lost rays that it replays."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from iriftrace.cli import checks
from iriftrace.cli.console import command_line, print_table, say, working, written_figure
from iriftrace.cli.options import Output, Whole
from iriftrace.cli.trace_options import load
from iriftrace.core.errors import InputError, warn
from iriftrace.tracing.options import TraceOptions

if TYPE_CHECKING:
    from iriftrace.image.lost_rays import LostRays
    from iriftrace.tracing.replay import Replay


def ray(
    file: Path,
    *,
    number: Whole = 1,
    scene: Path | None = None,
    output: Output | None = None,
    figures: bool = True,
) -> None:
    """Trace a lost ray again, with both engines and with an independent reference.

    ``render`` and ``measure`` write the first 20 rays whose end is not known (status 5 or 6) into
    a file ending in .rays.json, next to their result. The reference tests every triangle near the
    ray in double precision, and bends it at the facets of the shells alone. Where all three agree
    the ray is only doubtful; else the picture of the path shows where they part.

    Example: ``iriftrace ray out.rays.json --number 3``

    Parameters
    ----------
    file
        The rays.
    number
        Number of the ray in the file, from 1.
    scene
        The scene's XML file, if it is no longer where the file states.
    output
        Picture of the path, .png or .pdf; by default next to the file.
    figures
        Draw the path.
    """
    from iriftrace.io.lost_rays import SUFFIX, read_lost_rays
    from iriftrace.tracing.replay import replay_ray

    checks.inputs(file)
    picture = file.with_name(f"{file.name.removesuffix(SUFFIX)}_ray_{number}.png")
    picture = picture if output is None else output
    checks.output(picture, "ray.png", ".pdf")
    rays = read_lost_rays(file)
    chosen = next((one for one in rays.rays if one.number == number), None)
    if chosen is None:
        raise InputError(
            f"{file} has the rays 1 to {len(rays.rays)}, and no ray {number}; give one of them.",
            code="rays.no_number",
            argument="number",
        )
    loaded = load(_scene_of(rays, scene, file), _options(rays))
    if loaded.sha256 != rays.scene.sha256:
        warn(
            f"{loaded.name} is not the file in which the ray was lost (its checksum differs), so "
            "the ray may take another path."
        )
    with working("Tracing"):
        found = replay_ray(loaded, chosen)
    _say(found, rays)
    if figures:
        from iriftrace.figures.ray import ray_figure

        say(f"Files: {written_figure(lambda: ray_figure(found), picture)}")


def write_rays(result: Path, rays: LostRays | None) -> list[Path]:
    """Write the lost rays of a result next to it, and say so; those of an earlier run go away."""
    from iriftrace.io.lost_rays import rays_file_of, write_lost_rays

    path = rays_file_of(result)
    if rays is None:
        # Other than the path's own method, this takes names that are too long.
        if os.path.exists(path):
            path.unlink()
        return []
    write_lost_rays(path, rays)
    say(
        f"{len(rays.rays)} of {rays.lost:,} lost rays are in {path}; replay one:  "
        f"{command_line('ray', path)}"
    )
    return [path]


def _options(rays: LostRays) -> TraceOptions:
    """The options with which the scene was traced; the engine is left to the scene."""
    return TraceOptions(
        define=[f"{key}={value}" for key, value in rays.scene.variables.items()],
        variant=rays.variant,
    )


def _scene_of(rays: LostRays, given: Path | None, file: Path) -> Path:
    path = given
    if path is None and rays.scene.path is not None:
        path = Path(rays.scene.path)
    if path is None:
        raise InputError(
            f"The rays in {file} are those of a scene without a file; name a file.",
            code="rays.no_scene",
            argument="scene",
        )
    checks.scenes(path)
    return path


def _say(found: Replay, rays: LostRays) -> None:
    """Print the ray, where each tracer ends, and how far from the reference."""
    ray = found.ray
    place, start = (", ".join(f"{v:.6g}" for v in values) for values in (ray.pixel, ray.origin_mm))
    member = "" if ray.member is None else f", member {ray.member}"
    say(
        f"Ray {ray.number} of {len(rays.rays)}: {ray.device} pixel ({place}) at ({start}) mm, "
        f"status {ray.status} with engine {rays.engine}{member}."
    )
    reference = found.paths[-1].end
    rows = [
        (
            path.tracer,
            *(f"{value:.6f}" for value in path.end),
            f"{1e3 * np.linalg.norm(path.end - reference):.3g}",
            f"{path.crossings:,}",
            f"{path.status.value}, {path.status.text}",
        )
        for path in found.paths
    ]
    headings = ("traced by", "x (mm)", "y (mm)", "z (mm)", "off (um)", "crossings", "status")
    print_table("Ends of the refracted ray", headings, rows, texts=["traced by", "status"])
    for engine, reason in found.left_out.items():
        say(f"Not traced by {engine}: {reason}")
    edge = found.paths[-1].edge_distance
    if edge is not None and np.isfinite(edge):
        say(f"It passes the edge of a triangle at {1e3 * edge:.3g} um.")
