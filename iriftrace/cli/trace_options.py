"""The options about tracing that ``iriftrace demo``, ``render`` and ``sweep`` share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from attrs import frozen
from cyclopts import Parameter

from iriftrace.cli.options import Variables, Wavelength, scene_variables

if TYPE_CHECKING:
    from iriftrace.scene import LoadedScene


@Parameter(name="*")
@frozen
class TraceOptions:
    """How a scene is traced.

    Parameters
    ----------
    define
        Scene parameter, name=value; repeatable.
    wavelength
        Wavelength of the light, "450 nm"; by default the one the scene was made for.
    variant
        Mitsuba variant, llvm_ad_mono or cuda_ad_mono.
    engine
        Bend rays at the shells, or along their curved path through the field itself, which needs
        the field.npz that ``iriftrace scene`` writes; by default what the scene's file says.
    """

    define: Variables = None
    wavelength: Wavelength = None
    variant: str | None = None
    engine: Literal["shells", "continuous"] | None = None

    def variables(self) -> dict[str, str]:
        """Scene parameters by name; InputError where the options give none."""
        return scene_variables(self.define, self.wavelength)

    def load(self, scene: Path) -> LoadedScene:
        """A scene with these options."""
        from iriftrace.scene import load_scene

        return load_scene(scene, self.variables(), variant=self.variant, engine=self.engine)
