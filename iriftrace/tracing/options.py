"""Options of tracing a scene's file, for Python and for commands."""

from __future__ import annotations

from typing import Literal

from attrs import field, frozen
from attrs.converters import optional as if_given

from iriftrace.core.engines import Engine, engine_named
from iriftrace.core.errors import InputError
from iriftrace.core.units import FNumber, Length, Wavelength

Normals = Literal["gradient", "facet"]

GRADIENT: Normals = "gradient"
"""Normals of shells: those of the field's gradient, as by default."""

SCALE = 0.5
"""Default factor on a scene's resolution."""


@frozen
class TraceOptions:
    """Parameters, light, variant and engine of a trace.

    Parameters
    ----------
    define
        Scene parameter, name=value; repeatable.
    wavelength
        Wavelength of the light, "450 nm"; by default the one the scene was made for.
    variant
        Mitsuba variant, llvm_ad_mono or cuda_ad_mono.
    engine
        Bend rays by the shells, or along their curved path through the field data, which needs
        the field.npz that ``iriftrace scene`` writes. By default the engine of the scene's file;
        if that is shells, but they are too few for a view, the field if it is available.
    """

    define: list[str] | None = None
    wavelength: Wavelength | None = field(default=None, converter=if_given(Wavelength))
    variant: str | None = None
    engine: Engine = field(default=Engine.AUTO, converter=engine_named)

    def variables(self) -> dict[str, str]:
        """Scene parameters by name, including the wavelength (nm) if it is given."""
        values = {}
        for text in self.define or []:
            name, equals, value = text.partition("=")
            if not (name and equals and value):
                raise InputError(
                    f'"{text}" is not a scene parameter; write it as name=value, such as '
                    "scale=0.25.",
                    code="scene.no_value",
                    argument="define",
                )
            values[name] = value
        if self.wavelength is not None:
            values["wavelength"] = repr(float(self.wavelength))
        return values


TRACE_AS_STATED = TraceOptions()


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
        camera's focus interval, or the part's centre if that has no far end.
    """

    aperture: FNumber | None = field(default=None, converter=if_given(FNumber))
    focus_distance: Length | None = field(default=None, converter=if_given(Length))

    def __attrs_post_init__(self) -> None:
        if self.aperture is None and self.focus_distance is not None:
            raise InputError(
                f"A focus distance of {self.focus_distance:g} mm belongs to an aperture; give that "
                "too, such as f/4.",
                code="aperture.focus_without",
                argument="aperture",
            )


PINHOLE = ApertureOptions()
