"""Tables and summaries that the command line prints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.table import Table

from iriftrace.core.units import ZERO_CELSIUS_K
from iriftrace.image.aov_image import Status

if TYPE_CHECKING:
    from iriftrace.camera.camera import Camera
    from iriftrace.field.part_fit import Fit
    from iriftrace.image.metrics import EnsembleMetrics, PoseMetrics, RayCounts, Statistics
    from iriftrace.scene.viewpoint import PartView
    from iriftrace.shells.report import ShellReport
    from iriftrace.shells.stack import ShellStack


MANY_SHELLS = 30
"""From here on still more shells hardly bring a picture closer to the field."""

MANY_MISMATCHES = 0.01
"""Share of the hits above which index steps that do not add up are no single rays at edges."""

TOO_FEW = "fewer than 100 good rays, so no numbers"


def print_shells(
    console: Console, stack: ShellStack, reports: Sequence[ShellReport], length_unit: str
) -> None:
    """One row per shell: index, temperature, size, openings, gaps and cuts."""
    table = Table(title=f"{len(stack.shells)} shells, {stack.triangles:,} triangles")
    for heading in ("shell", "(n - 1) 1e6", "degC", "triangles", "gap next", "gap part", "cut"):
        table.add_column(heading, justify="right")
    table.add_column("closed")
    for report in reports:
        table.add_row(
            str(report.layer),
            f"{report.refractivity * 1e6:.2f}",
            f"{report.temperature_k - ZERO_CELSIUS_K:.0f}",
            f"{report.triangles:,}",
            _length(report.gap_next_mm),
            _length(report.gap_part_mm),
            "" if report.part_cut_share is None else f"{report.part_cut_share:.2%}",
            "closed" if report.closed else "open at " + ", ".join(_openings(report)),
        )
    console.print(table)
    air = stack.air
    console.print(
        f"Ambient air n - 1 = {air.ambient_refractivity:.4e} at "
        f"{air.temperature_k - ZERO_CELSIUS_K:g} degC, {air.wavelength_nm:g} nm; index rule "
        f"{stack.rule}; lengths in mm, field read in {length_unit}; cut: share of a shell inside "
        "the part."
    )
    if stack.source is not None and stack.source.origin:
        console.print(f"Field: {stack.source.origin}.", markup=False, soft_wrap=True)
    for small in stack.small_components:
        console.print(
            f"Shell {small.layer}: {small.components} small pieces dropped "
            f"({small.triangles} triangles)."
        )


def _length(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"


def _openings(report: ShellReport) -> list[str]:
    return [f"{place} ({edges} edges)" for place, edges in report.open_at]


def print_fit(console: Console, fit: Fit) -> None:
    """Print the gap between the field's inner wall and the part, and the wall's temperature."""
    temperature = "not known"
    if np.isfinite(fit.wall_temperature_k):
        temperature = f"{fit.wall_temperature_k - ZERO_CELSIUS_K:.0f} degC"
    if np.isfinite(fit.gap_median_mm):
        console.print(
            f"Field's wall to part: gap median {fit.gap_median_mm:.3f} mm, 95th percentile "
            f"{fit.gap_p95_mm:.3f} mm; wall temperature {temperature}."
        )
    else:
        console.print(f"Air at the part's surface: temperature {temperature}.")


def print_camera(console: Console, camera: Camera, scale: float) -> None:
    """Position and picture of a camera."""
    x, y, z = (f"{v:.1f}" for v in camera.origin)
    width, height = camera.scaled(scale).resolution
    near, far = camera.focus_mm
    console.print(
        f"Camera at ({x}, {y}, {z}) mm, focal length {camera.focal_length_mm:g} mm, "
        f"{width} x {height} px, focus {near:g} to {far:g} mm."
    )
    if camera.distortion is not None:
        console.print(f"Lens distortion {camera.distortion}.")


def print_view(console: Console, view: PartView, remedy: str) -> None:
    """Say what share of the part a picture does not hold, where there is one, and a remedy."""
    shares = {"outside the picture": view.outside, "out of focus": view.out_of_focus}
    missing = [f"{_percent(share)} {place}" for place, share in shares.items() if share >= 0.0005]
    if missing:
        console.print(
            f"Of what the part turns to the camera lie {' and '.join(missing)}; {remedy}.",
            markup=False,
            soft_wrap=True,
        )


def print_summary(console: Console, metrics: PoseMetrics) -> None:
    """Print the metrics of one pose and the assumptions behind them."""
    from iriftrace.image.resolution import FRONTAL, seen_frontally

    table = Table(title="Displacement by hot air", title_justify="left", show_header=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    displacement, shift = metrics.displacement_mm, metrics.shift_px
    table.add_row(
        "displacement",
        TOO_FEW if displacement.median is None else _micrometres(displacement),
    )
    table.add_row(
        "across / along line of sight",
        f"{_scaled(metrics.displacement_lateral_mm, 1e3, 'um')} / "
        f"{_scaled(metrics.displacement_axial_mm, 1e3, 'um')} (mean)",
    )
    table.add_row(
        "shift in the picture",
        ", ".join(
            f"{key} {_scaled(getattr(shift, key), 1, 'px')}" for key in ("median", "p95", "max")
        ),
    )
    if metrics.ensemble is not None:
        _add_ensemble(table, metrics.ensemble)
    if metrics.shells_against_field is not None:
        _add_shell_error(table, metrics.shells_against_field)
    table.add_row(
        "coverage",
        f"{_percent(metrics.coverage)} of the part's area in faces hit, "
        f"{_percent(metrics.coverage_area)} by pixel area",
    )
    lateral, axial = metrics.lateral_resolution_mm, metrics.axial_resolution_mm
    frontal = lateral is not None and axial is not None and seen_frontally(lateral, axial)
    table.add_row(
        "resolution",
        f"lateral {_scaled(lateral, 1e3, 'um')}, axial "
        f"{f'0 ({FRONTAL})' if frontal else _scaled(axial, 1e3, 'um')} (step to the next pixel)",
    )
    if metrics.full_camera is not None:
        _add_full_camera(table, metrics.full_camera)
    rays = metrics.rays
    table.add_row("rays", f"{rays.launched:,} launched, {rays.hit:,} hit the part")
    for status in Status:
        if rays.of(status):
            share = _out_of_hits(status, rays)
            table.add_row("", f"{rays.of(status):,} {status.text}{share}")
    if rays.index_mismatch > MANY_MISMATCHES * max(rays.hit, 1):
        table.add_row(
            "",
            "so many do not add up that shells have holes or are another field's; make the scene "
            "anew, without --triangles if it was thinned out",
        )
    if rays.open_boundary:
        table.add_row(
            "",
            f"{rays.open_boundary:,} of the good ones pass an open end of the data; "
            "the plume beyond is not modelled",
        )
    for name, values in metrics.regions.items():
        median = values.displacement_mm.median
        table.add_row(
            f"region {name}",
            TOO_FEW
            if median is None
            else f"median {_scaled(median, 1e3, 'um')}, coverage {_percent(values.coverage)}",
        )
    table.add_row(
        "time",
        ", ".join(
            f"{key} {value:.2f} s"
            for key, value in metrics.time_s.items()
            if value and value >= 0.005
        ),
    )
    console.print(table)
    console.print("Assumptions in force:", style="bold")
    for key, value in metrics.assumptions.items():
        text = ", ".join(value) if isinstance(value, list) else value
        console.print(f"  {key.replace('_', ' ')}: {text}", markup=False, soft_wrap=True)


def _add_ensemble(table: Table, values: EnsembleMetrics) -> None:
    """Bias and scatter: the numbers above are those of the mean."""
    table.add_row(
        "bias",
        f"displacement and shift above are means over {values.members} fields; they can be "
        "corrected",
    )
    if values.scatter_mm.median is not None:
        table.add_row(
            "scatter",
            _micrometres(values.scatter_mm) + " (standard deviation, cannot be corrected)",
        )
    table.add_row(
        "",
        f"{values.rays_in_all:,} rays count in all fields, {values.rays_in_some:,} only in some",
    )


def _add_full_camera(table: Table, values: dict[str, Any]) -> None:
    """Shifts and resolutions without the picture's scale."""
    width, height = values["resolution"]
    shift = ", ".join(
        f"{key} {_scaled(values['shift_px'][key], 1, 'px')}" for key in ("median", "p95", "max")
    )
    table.add_row(f"with all {width} x {height} px", f"shift {shift}")
    lateral, axial = (values[f"{name}_resolution_mm"] for name in ("lateral", "axial"))
    table.add_row(
        "", f"lateral {_scaled(lateral, 1e3, 'um')}, axial {_scaled(axial, 1e3, 'um')} (step)"
    )


def _add_shell_error(table: Table, values: dict[str, Any]) -> None:
    """Difference between the shells and the field they were cut from, with a remedy if large."""
    table.add_row(
        "shells against field",
        f"median {_scaled(values['median_mm'], 1e3, 'um')} ({values['median_share']:.1%} of the "
        f"displacement's without shells), p95 {_scaled(values['p95_mm'], 1e3, 'um')} "
        f"({values['p95_share']:.1%}); sample of {values['rays']:,} rays",
    )
    if not values["suffice"]:
        more = "cut more shells (--layers 40), or " if values["shells"] < MANY_SHELLS else ""
        table.add_row("", f"closer: {more}trace with --engine continuous")
        table.add_row("", "if they were thinned out, leave --triangles out first")


def _out_of_hits(status: Status, rays: RayCounts) -> str:
    if status is Status.MISSED or not rays.hit:
        return ""
    return f" ({rays.of(status) / rays.hit:.2%} of the hits)"


def _micrometres(values: Statistics) -> str:
    keys = ("median", "mean", "p95", "max")
    return ", ".join(f"{key} {_scaled(getattr(values, key), 1e3, 'um')}" for key in keys)


def _scaled(value: float | None, factor: float, unit: str) -> str:
    return "n/a" if value is None or not np.isfinite(value) else f"{value * factor:.4g} {unit}"


def _percent(value: float | None) -> str:
    return "n/a" if value is None else f"{value:.1%}"
