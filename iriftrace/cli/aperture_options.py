"""Options about the aperture of the devices' lenses, and its effect."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated

from attrs import frozen
from cyclopts import Group, Parameter

from iriftrace.cli.console import say, working
from iriftrace.cli.options import Length, word_parameter
from iriftrace.core.errors import InputError, without_warnings

if TYPE_CHECKING:
    from iriftrace.camera.camera import Camera
    from iriftrace.core.plain import JsonObject
    from iriftrace.tracing.scene import Scene


def _f_number(text: str, option: str) -> float:
    first, _, number = text.partition("/")
    try:
        if first.strip().lower() != "f":
            raise ValueError
        return float(number)
    except ValueError:
        raise InputError(
            f'{option} is "{text}"; write it as the f-number, such as f/4.',
            code="aperture.not_read",
        ) from None


@Parameter(name="*", group=Group("Aperture", sort_key=6))
@frozen
class ApertureOptions:
    """The lenses' aperture; by default each camera is a pinhole.

    Parameters
    ----------
    aperture
        f-number of the lens, "f/4": also trace 32 rays over it for 2,000 pixels, and state bias and
        blur of the shift against the pinhole. No picture or point changes.
    focus_distance
        Distance of the plane in focus from the lens, along its axis; by default the middle of the
        camera's focus interval.
    """

    aperture: Annotated[float | None, word_parameter("f/NUMBER", _f_number, "f/{:g}".format)] = None
    focus_distance: Length | None = None

    def effects(self, scene: Scene, devices: Mapping[str, Camera]) -> JsonObject:
        """Plain values by the name of each device, printed as sentences; none without aperture."""
        from iriftrace.tracing.aperture import aperture_effect

        if self.aperture is None:
            if self.focus_distance is not None:
                raise InputError(
                    f"--focus-distance is {self.focus_distance:g} mm, which belongs to --aperture; "
                    "give that too, such as f/4.",
                    code="aperture.focus_without",
                )
            return {}
        found = {}
        # The picture or the scan itself warns of its shells.
        with working("Tracing over the lens"), without_warnings():
            for name, device in devices.items():
                effect = aperture_effect(
                    scene, self.aperture, camera=device, focus_mm=self.focus_distance
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
