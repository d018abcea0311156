"""Options of synthetic fields, for Python and for commands."""

from __future__ import annotations

from attrs import field, frozen
from attrs.converters import optional

from iriftrace.core.units import Length, Temperature

WALL = Temperature("1100 degC")
"""Temperature of a part that states none."""


@frozen
class SyntheticOptions:
    """Air and mesh of a synthetic field.

    Parameters
    ----------
    wall_temperature
        Temperature of the part; by default that of the hot part (hot-temperature), else 1100 degC.
    region_temperature
        Another temperature for a region of the part, NAME=TEMPERATURE, or for all that match a
        pattern, "plane -x*=900 degC"; repeatable.
    transition
        Width over which one wall temperature changes into another; by default the boundary
        layer's thickness.
    ambient
        Temperature of the room.
    boundary_layer
        Thickness of the boundary layer; by default that of laminar convection at the part's size.
    plume
        Excess temperature of the plume above the part's top, as a fraction of the wall's; 0 for
        none.
    cell_size
        Size of the cells at the wall; by default a fifth of the boundary layer.
    sides
        Air next to and below the part; by default as far as it is warm.
    height
        Air above the part, above which the plume is cut off.
    gradient
        Add the analytic gradient as array grad_T, K/mm.
    """

    wall_temperature: Temperature | None = field(default=None, converter=optional(Temperature))
    region_temperature: list[str] | None = None
    transition: Length | None = field(default=None, converter=optional(Length))
    ambient: Temperature = field(default=Temperature("20 degC"), converter=Temperature)
    boundary_layer: Length | None = field(default=None, converter=optional(Length))
    plume: float = 0.8
    cell_size: Length | None = field(default=None, converter=optional(Length))
    sides: Length | None = field(default=None, converter=optional(Length))
    height: Length | None = field(default=None, converter=optional(Length))
    gradient: bool = False


STANDARD_SYNTHETIC = SyntheticOptions()
