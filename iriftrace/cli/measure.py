"""The command ``iriftrace measure``: the cloud that two devices measure through hot air."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from attrs import evolve
from cyclopts import Parameter

from iriftrace.cli import checks
from iriftrace.cli.aperture_options import Aperture, effects_of, say_effects
from iriftrace.cli.console import say, working, written_figure
from iriftrace.cli.groups import group
from iriftrace.cli.options import Flag, Output
from iriftrace.cli.ray import write_rays
from iriftrace.cli.trace_options import Tracing, load
from iriftrace.core.engines import engine_named
from iriftrace.core.units import counted
from iriftrace.measuring.options import USUAL_DEVICES, MeasureOptions
from iriftrace.tracing.options import PINHOLE, TRACE_AS_STATED

if TYPE_CHECKING:
    from iriftrace.core.plain import JsonObject
    from iriftrace.measuring.two_devices.scan import Scan
    from iriftrace.tracing.scene import Scene

_USUAL = 0.999
"""Fraction of the points to whose largest error that of all is compared."""

_FAR = 3.0
"""Ratio of these errors from which a comparison is advised; it changes no number."""

Devices = Annotated[MeasureOptions, group(MeasureOptions, gate=Parameter(metavar="NUMBER|none"))]
"""Options of two devices and of fitted features: the same for measure and correct."""


def measure(
    scene: Path,
    *,
    output: Output = Path("scan.vtp"),
    devices: Devices = USUAL_DEVICES,
    acceptance: Flag = False,
    trace: Tracing = TRACE_AS_STATED,
    figures: bool = True,
    lens: Aperture = PINHOLE,
) -> None:
    """Simulate what two devices measure of the part through hot air: a cloud and its errors.

    The scene's first sensor is the camera; its second one, with the id camera_2, projector or
    laser, completes a stereo, fringe or laser sensor.

    Example: ``iriftrace measure scene/scene.xml -o scan.vtp --feature cylinder``

    Parameters
    ----------
    scene
        The scene's XML file.
    output
        The cloud, .vtp, .ply, .e57, .asc, .xyz, .txt or .csv; its numbers (.json) and picture
        (.png) go next to it.
    acceptance
        Print the errors that VDI/VDE 2634 tests on the part's spheres and planes: probing error of
        form and of size, sphere-spacing error, flatness error.
    figures
        Draw the errors along the part's normal.
    """
    from iriftrace.io.lost_rays import rays_file_of

    checks.scenes(scene)
    checks.cloud_output(output, "scan.vtp")
    checks.numbers(output, "iriftrace.scan")
    checks.numbers(rays_file_of(output), "iriftrace.rays")
    loaded = load(scene, trace)
    checks.kept(output, loaded.part.path)
    sensors = {"camera": loaded.camera}
    if loaded.second is not None and loaded.second_id != "laser":
        sensors[loaded.second_id] = loaded.second
    effects = effects_of(lens, loaded, sensors)
    write_scan(loaded, output, devices, acceptance=acceptance, figures=figures, aperture=effects)
    say_effects(effects)


def write_scan(
    loaded: Scene,
    output: Path,
    devices: MeasureOptions = USUAL_DEVICES,
    *,
    acceptance: bool = False,
    figures: bool = True,
    aperture: JsonObject | None = None,
) -> None:
    """Simulate the measurement of a scene's two devices, write its files and print results."""
    from iriftrace.cli.triangulation_text import (
        placed_names,
        print_regions,
        say_features,
        say_group,
        say_points,
        say_relations,
    )
    from iriftrace.figures.describe_scan import describe, um
    from iriftrace.measuring.features.choice import checked_choices
    from iriftrace.measuring.two_devices.acceptance import acceptance as accepted
    from iriftrace.measuring.two_devices.measure import measure as simulate

    choices = checked_choices(devices.feature or (), loaded.part)
    with working("Measuring"):
        scan = simulate(loaded, system=devices.system, phase=devices.phase)
    if aperture:
        scan = evolve(scan, provenance={**scan.provenance, "aperture": aperture})
    features = scan.features(loaded.part, choices, devices.gate)
    errors = accepted(features, loaded.part) if acceptance else ()
    regions = scan.regions(loaded.part)
    related = scan.relations(features)
    cloud, numbers = scan.save(output, features, errors, regions, related)
    files = [cloud, numbers]
    if figures:
        from iriftrace.figures.scan import scan_figure

        files.append(
            written_figure(lambda: scan_figure(scan, loaded.part), output.with_suffix(".png"))
        )
    files += write_rays(output, scan.lost_rays)
    names = placed_names(loaded.part)
    rows = describe(scan.values(features, errors, regions, related), names)
    say_points(rows)
    say_group(rows, "field")
    say("Files: " + ", ".join(map(str, files)))
    _say_far_points(scan)
    say_features(rows, "cold", devices.gate)
    say_relations(rows, "cold")
    print_regions(rows, "Error along the normal by region")
    for tested in errors:
        measured, cold = (um(tested.error_mm[name]) for name in ("measured", "cold"))
        # Of two regions that have a distance, the names are in the text.
        where = names.get(tested.region, tested.region or "all points")
        say(f"{tested.error.capitalize()} ({where}): {measured} through hot air, {cold} cold.")


def _say_far_points(scan: Scan) -> None:
    """Say that few points, for which shells are too coarse, determine form deviations."""
    from iriftrace.figures.describe_scan import um

    size = np.abs(scan.error_normal)
    usual = float(np.quantile(size, _USUAL))
    engine = engine_named(scan.provenance["engine"])
    if not engine.through_cells and size.max() > _FAR * usual:
        say(
            f"{counted(int((size > _FAR * usual).sum()), 'point')} of {len(size):,} have errors of "
            f"up to {um(size.max())}, while {_USUAL:.1%} have at most {um(usual)}: the shells may "
            "be too coarse for them, and form deviations depend on such points; compare with "
            "--engine cells."
        )
