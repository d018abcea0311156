"""Bias and blur of the lenses' aperture, as commands compute and print them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated

from iriftrace.cli.console import say, working
from iriftrace.cli.groups import group
from iriftrace.core.errors import without_warnings
from iriftrace.tracing.options import ApertureOptions

if TYPE_CHECKING:
    from iriftrace.camera.camera import Camera
    from iriftrace.core.plain import JsonObject
    from iriftrace.tracing.scene import Scene

Aperture = Annotated[ApertureOptions, group(ApertureOptions, "Aperture", 6)]


def effects_of(options: ApertureOptions, scene: Scene, devices: Mapping[str, Camera]) -> JsonObject:
    """Plain values by the name of each device; none without an aperture."""
    from iriftrace.tracing.aperture import aperture_effect

    if options.aperture is None:
        return {}
    found = {}
    # The picture or the scan itself warns of its shells.
    with working("Tracing over the lens"), without_warnings():
        for name, device in devices.items():
            effect = aperture_effect(
                scene, options.aperture, camera=device, focus_mm=options.focus_distance
            )
            found[name] = effect.as_dict()
    return found


def say_effects(effects: JsonObject) -> None:
    """Print bias and blur of each device."""
    for name, one in effects.items():
        shift, bias, blur, rest = (
            f"{one[key]['median']:.2g}" for key in ("shift_px", "bias_px", "blur_px", "defocus_px")
        )
        say(
            f"Aperture f/{one['f_number']:g} of the {name}, in focus at {one['focus_mm']:g} mm: "
            f"bias {bias} px, blur {blur} px of a shift of {shift} px (medians of "
            f"{one['pixels']:,} pixels); out of focus without hot air {rest} px."
        )
