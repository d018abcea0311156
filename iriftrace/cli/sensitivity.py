"""The command ``iriftrace sensitivity``: which air moves a measured diameter."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from iriftrace.cli import checks
from iriftrace.cli.console import print_table, say, working, written_figure
from iriftrace.cli.measure import Devices
from iriftrace.cli.options import Output
from iriftrace.cli.trace_options import Tracing, load
from iriftrace.core.errors import InputError
from iriftrace.measuring.options import USUAL_DEVICES
from iriftrace.tracing.options import TRACE_AS_STATED

if TYPE_CHECKING:
    from iriftrace.measuring.two_devices.sensitivity import Sensitivity


def sensitivity(
    scene: Path,
    *,
    output: Output = Path("sensitivity.vtu"),
    devices: Devices = USUAL_DEVICES,
    trace: Tracing = TRACE_AS_STATED,
    figures: bool = True,
) -> None:
    """Differentiate a measured diameter by the temperature at every point of the air.

    The measurement of two devices is simulated through the field's cells, and its derivative comes
    from two reverse passes, however many points there are. Give one --feature.

    Example: ``iriftrace sensitivity scene/scene.xml --feature cylinder:lateral -o out.vtu``

    Parameters
    ----------
    scene
        The scene's XML file, with its field file.
    output
        The derivatives at the points of the air, um/K, .vtu for ParaView; the numbers (.json) and a
        picture (.png) go next to it.
    figures
        Draw where the air is that moves the diameter.
    """
    from iriftrace.measuring.two_devices.sensitivity import sensitivity as differentiate

    checks.scenes(scene)
    checks.output(output, "sensitivity.vtu")
    checks.numbers(output, "iriftrace.sensitivity")
    chosen = devices.feature or ()
    if len(chosen) != 1:
        raise InputError(
            f"{len(chosen)} features are requested, but a derivative is that of one diameter; give "
            "one, such as cylinder:lateral.",
            code="feature.not_one",
            argument="feature",
        )
    loaded = load(scene, trace)
    with working("Measuring and differentiating"):
        found = differentiate(
            loaded, chosen[0], gate=devices.gate, system=devices.system, phase=devices.phase
        )
    files = list(found.save(output))
    if figures:
        from iriftrace.figures.sensitivity import sensitivity_figure

        files.append(
            written_figure(
                lambda: sensitivity_figure(found, loaded.part), output.with_suffix(".png")
            )
        )
    _say(found)
    say("Files: " + ", ".join(map(str, files)))


def _say(found: Sensitivity) -> None:
    from iriftrace.figures.describe_scan import um

    moved = found.measured_mm - found.cold_mm
    say(f"{found.name}: {found.measured_mm:.4f} mm as measured, {um(moved)} by hot air.")
    say(f"{found.sentence}.")
    rows = [(name, um(effect)) for name, effect in found.effects.items()]
    print_table("Effect on the diameter, to first order", ("input", "change"), rows)
