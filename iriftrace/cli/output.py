"""Tables and summaries printed by the command line."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from attrs import asdict
from rich.table import Table

from iriftrace.cli.console import out, print_table, say
from iriftrace.core.units import ZERO_CELSIUS_K, counted
from iriftrace.figures.describe import assumption_rows, camera_text, place_text, ray_rows
from iriftrace.image.aov_image import Status
from iriftrace.image.ray_statistics import OF_MET, TOO_FEW

if TYPE_CHECKING:
    from iriftrace.camera.camera import Camera
    from iriftrace.camera.pose_set import PoseSet
    from iriftrace.image.metrics import PoseMetrics
    from iriftrace.image.ray_statistics import EnsembleMetrics, RayCounts
    from iriftrace.medium.part_fit import Fit
    from iriftrace.medium.shells.report import ShellReport
    from iriftrace.medium.shells.stack import ShellStack
    from iriftrace.part.part import Part


LEAST_OUTSIDE = 0.0005
"""Fraction of a part outside the picture or focus from which it is printed."""

_MOST_VIEWS = 40
"""Number of poses from which an average over an orbit is known to a per cent or two."""


def print_shells(stack: ShellStack, reports: Sequence[ShellReport], fit: Fit | None) -> None:
    """One row per shell: index, temperature, size, openings, gaps and cuts; and the part's fit."""
    from iriftrace.medium.part_fit import LARGEST_GAP_MM

    headings = ("shell", "(n - 1) 1e6", "degC", "triangles", "gap next", "gap part", "cut")
    rows = []
    open_at: dict[str, list[str]] = {}
    for report in reports:
        for place, _ in report.open_at:
            open_at.setdefault(place, []).append(str(report.layer))
        row = (
            report.layer,
            f"{report.refractivity * 1e6:.2f}",
            f"{report.temperature_k - ZERO_CELSIUS_K:.0f}",
            f"{report.triangles:,}",
            _length(report.gap_next_mm),
            _length(report.gap_part_mm),
            "" if report.part_cut_share is None else f"{report.part_cut_share:.2%}",
            "closed" if report.closed else f"{sum(edges for _, edges in report.open_at):,}",
        )
        rows.append(row)
    print_table(
        f"{counted(len(stack.shells), 'shell')}, {counted(stack.triangles, 'triangle')}",
        (*headings, "open edges"),
        rows,
    )
    air, source = stack.air, stack.source
    out.print(
        f"Ambient air n - 1 = {air.ambient_refractivity:.4e} at "
        f"{air.temperature_k - ZERO_CELSIUS_K:g} degC, {air.wavelength_nm:g} nm; index rule "
        f"{stack.rule}; lengths in mm, field read in "
        f"{'mm' if source is None else source.length_unit}; gap: smallest distance to the next "
        "shell and to the part; cut: fraction of a shell inside the part."
    )
    for place, layers in open_at.items():
        out.print(f"Open at the {place}: shells {', '.join(layers)}.")
    if source is not None and source.origin:
        say(f"Field: {source.origin}.")
    for small in stack.small_components:
        out.print(
            f"Shell {small.layer}: {counted(small.components, 'small piece')} dropped "
            f"({counted(small.triangles, 'triangle')})."
        )
    if fit is None:
        return
    temperature = "not known"
    if np.isfinite(fit.wall_temperature_k):
        temperature = f"{fit.wall_temperature_k - ZERO_CELSIUS_K:.0f} degC"
    if np.isfinite(fit.gap_median_mm):
        contact = " or in contact with a body" if fit.contact_share else ""
        out.print(
            f"Field's wall and part: 95 % of the wall is within {fit.gap_p95_mm:.3f} mm of the "
            f"part, {1.0 - fit.bare_share:.1%} of the part within {LARGEST_GAP_MM} mm of the "
            f"wall{contact}; wall temperature {temperature}."
        )
    else:
        out.print(f"Air at the part's surface: temperature {temperature}.")


def _length(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"


def print_camera(camera: Camera, scale: float) -> None:
    """Position and picture of a camera."""
    values = camera.scaled(scale).as_dict()
    out.print(f"Camera {place_text(values)}; {camera_text(values)}.")
    if camera.distortion is not None:
        out.print(f"Lens distortion {camera.distortion}.")


def print_view(part: Part, camera: Camera, move: str, refocus: str, end: str = "") -> None:
    """Print the fractions of the part outside the picture and focus, if any, and the remedies.

    `move` helps against both, `refocus` only where the part is out of focus.
    """
    from iriftrace.tracing.viewpoint import part_view

    view = part_view(part, camera)
    if missing := _missing(view.outside, view.out_of_focus, LEAST_OUTSIDE, ".1%"):
        remedy = " or ".join([move] + [refocus] * (view.out_of_focus >= LEAST_OUTSIDE))
        say(f"{missing}; {remedy}{end}.")


def print_default_orbit(stand_off_mm: float, poses: PoseSet, part: Part, camera: Camera) -> None:
    """Print how much of the part cameras at the default distance miss, if it is 1 % or more."""
    from iriftrace.tracing.viewpoint import part_view

    matrices = poses.matrices[:: math.ceil(len(poses) / _MOST_VIEWS)]
    views = [part_view(part, camera.at(matrix)) for matrix in matrices]
    outside, blurred = np.mean([(view.outside, view.out_of_focus) for view in views], axis=0)
    if missing := _missing(outside, blurred, 0.01, ".0%"):
        say(
            f"{missing} on average over the poses, {stand_off_mm:g} mm off the part; change this "
            "distance (--stand-off), or the focus interval or focal length of the scene's sensor."
        )


def _missing(outside: float, blurred: float, least: float, digits: str) -> str:
    """What a camera does not see sharply, if it is at least some fraction, half a sentence."""
    fractions = {"outside the picture": outside, "out of focus": blurred}
    missing = [f"{x:{digits}} is {place}" for place, x in fractions.items() if x >= least]
    facing = "Of the part's side that faces the camera"
    return f"{facing} {' and '.join(missing)}" if missing else ""


def print_summary(metrics: PoseMetrics) -> None:
    """Print the metrics of one pose and the assumptions behind them."""
    from iriftrace.image.resolution import FRONTAL, STEP, seen_frontally

    table = Table(title="Displacement by hot air", title_justify="left", show_header=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    displacement = asdict(metrics.displacement_mm)
    table.add_row(
        "displacement", TOO_FEW if displacement["median"] is None else _in_um(displacement)
    )
    across, along = _um(metrics.displacement_lateral_mm), _um(metrics.displacement_axial_mm)
    table.add_row("across / along line of sight", f"{across} / {along} (mean)")
    table.add_row("shift in the picture", _in_pixels(asdict(metrics.shift_px)))
    if metrics.ensemble is not None:
        _add_ensemble(table, metrics.ensemble)
    table.add_row(
        "coverage",
        f"{_percent(metrics.coverage_area)} of the part's area seen (faces hit: "
        f"{_percent(metrics.coverage)})",
    )
    lateral, axial = metrics.lateral_resolution_mm, metrics.axial_resolution_mm
    frontal = lateral is not None and axial is not None and seen_frontally(lateral, axial)
    table.add_row(
        "resolution",
        f"lateral {_um(lateral)}, axial {f'0 ({FRONTAL})' if frontal else _um(axial)} ({STEP})",
    )
    full = metrics.full_camera
    if full is not None:
        # Shifts and resolutions without the picture's scale.
        width, height = full["resolution"]
        table.add_row(f"with all {width} x {height} px", f"shift {_in_pixels(full['shift_px'])}")
        lateral, axial = full["lateral_resolution_mm"], full["axial_resolution_mm"]
        table.add_row("", f"lateral {_um(lateral)}, axial {_um(axial)} (step)")
    _add_rays(table, metrics.rays)
    for name, values in metrics.regions.items():
        median = values.displacement_mm.median
        table.add_row(
            f"region {name}",
            TOO_FEW
            if median is None
            else f"median {_um(median)}, coverage {_percent(values.coverage_area)}",
        )
    times = {key: value for key, value in metrics.time_s.items() if value and value >= 0.005}
    table.add_row("time", ", ".join(f"{key} {value:.2f} s" for key, value in times.items()))
    out.print(table)
    out.print("Assumptions in force:", style="bold")
    for name, text in assumption_rows(metrics.assumptions):
        say(f"  {name}: {text}")


def _add_rays(table: Table, rays: RayCounts) -> None:
    table.add_row("rays", f"{rays.launched:,} launched, {rays.hit:,} hit the part")
    for outcome, count, fraction in ray_rows({status: rays.of(status) for status in Status}):
        met = f" ({fraction} {OF_MET})" if fraction else ""
        table.add_row("", f"{count} {outcome}{met}")
    if rays.open_boundary:
        table.add_row(
            "",
            f"{rays.open_boundary:,} of the good ones pass an open end of the data; "
            "the plume beyond is not modelled",
        )


def _add_ensemble(table: Table, values: EnsembleMetrics) -> None:
    """Bias and scatter: the numbers above are those of the mean."""
    table.add_row(
        "bias",
        f"displacement and shift above are means over {values.members} fields; they can be "
        "corrected",
    )
    if values.scatter_mm.median is not None:
        scatter = _in_um(asdict(values.scatter_mm))
        table.add_row("scatter", f"{scatter} (standard deviation, cannot be corrected)")
    if values.worst_mm.median is not None:
        table.add_row(
            "worst member",
            f"{_in_um(asdict(values.worst_mm))}; in most pixels that is member "
            f"{values.worst_member}",
        )
    table.add_row(
        "", f"{values.rays_in_all:,} rays count in all fields, {values.rays_in_some:,} only in some"
    )


def _in_um(statistics_mm: Mapping[str, float | None]) -> str:
    return ", ".join(f"{key} {_um(statistics_mm[key])}" for key in ("median", "mean", "p95", "max"))


def _in_pixels(statistics: Mapping[str, float | None]) -> str:
    keys = ("median", "p95", "max")
    return ", ".join(f"{key} {_scaled(statistics[key], 1, 'px')}" for key in keys)


def _um(millimetres: float | None) -> str:
    if millimetres is not None and abs(millimetres) >= 10.0:
        return _scaled(millimetres, 1.0, "mm")
    return _scaled(millimetres, 1e3, "um")


def _scaled(value: float | None, factor: float, unit: str) -> str:
    return "n/a" if value is None or not np.isfinite(value) else f"{value * factor:.4g} {unit}"


def _percent(value: float | None) -> str:
    return "n/a" if value is None else f"{value:.1%}"
