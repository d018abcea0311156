"""Options of a simulation, and the case they stand for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from attrs import evolve, frozen
from cyclopts import Group, Parameter

from iriftrace.cli.options import Whole, optional_quantity, quantity
from iriftrace.cli.part_options import PartOptions
from iriftrace.errors import InputError

if TYPE_CHECKING:
    from iriftrace.openfoam.case import Case
    from iriftrace.part import Part

SIMULATION = Group("Simulation", sort_key=1)


@Parameter(name="*", group=SIMULATION)
@frozen
class SimulationOptions:
    """What is simulated, how finely and how long.

    Parameters
    ----------
    wall_temperature
        Temperature of the part's wall, "1100 degC".
    region_temperature
        Another temperature for a named region of the part, NAME=TEMPERATURE; repeatable.
    transition
        Width over which one wall temperature goes over into another (10 % to 90 %), "10 mm"; by
        default they meet in a line.
    ambient
        Temperature of the air far away.
    pressure
        Air pressure.
    resolution
        How fine the mesh is.
    background_cell
        Edge of the mesh's largest cells in place of that of the resolution, "40 mm"; those at the
        wall have a sixteenth.
    symmetry
        Compute a half or a quarter and mirror it at the part's centre; the field is then exactly
        symmetric, which a real plume is not.
    margin
        Factor on the air around the part.
    end_time
        Physical time to simulate; by default 2 s, longer for large or cool parts.
    average_time
        Interval before the end over which the density is averaged; by default a quarter.
    snapshots
        States from that interval to keep besides the average, as an ensemble.
    """

    wall_temperature: str
    region_temperature: Annotated[list[str] | None, Parameter(negative=())] = None
    transition: str = "0 mm"
    ambient: str = "20 degC"
    pressure: str = "101325 Pa"
    resolution: Literal["coarse", "normal", "fine", "extra-fine"] = "normal"
    background_cell: str | None = None
    symmetry: Literal["none", "x", "y", "xy"] = "none"
    margin: float = 1.0
    end_time: str | None = None
    average_time: str | None = None
    snapshots: Whole = 0

    def case(self, part: Part, processes: int) -> Case:
        """The case these options describe.

        Raises
        ------
        InputError
            It cannot be simulated.
        """
        import numpy as np

        from iriftrace.openfoam.case import Case
        from iriftrace.openfoam.resolution import mesh_size
        from iriftrace.openfoam.times import natural_times
        from iriftrace.openfoam.wall import WallTemperatures

        wall = WallTemperatures(
            default=quantity(self.wall_temperature, "kelvin", "--wall-temperature"),
            regions=self._regions(),
            transition=quantity(self.transition, "mm", "--transition"),
        )
        ambient = quantity(self.ambient, "kelvin", "--ambient")
        wall.check(part, ambient)
        extents = np.ptp(part.bounds, axis=0)
        return Case(
            part=part,
            wall=wall,
            size=mesh_size(
                self.resolution,
                extents,
                optional_quantity(self.background_cell, "mm", "--background-cell"),
            ),
            times=natural_times(
                float(extents.max()),
                wall.hottest,
                ambient,
                end=optional_quantity(self.end_time, "second", "--end-time"),
                averaging=optional_quantity(self.average_time, "second", "--average-time"),
                snapshots=self.snapshots,
            ),
            ambient_k=ambient,
            pressure_pa=quantity(self.pressure, "pascal", "--pressure"),
            mirrors="" if self.symmetry == "none" else self.symmetry,
            margin=self.margin,
            processes=processes,
        )

    def _regions(self) -> dict[str, float]:
        found: dict[str, float] = {}
        for text in self.region_temperature or []:
            name, equals, value = text.rpartition("=")
            if not (name and equals and value):
                raise InputError(
                    f'--region-temperature is "{text}"; write it as NAME=TEMPERATURE, such as '
                    '"head +x=450 degC".'
                )
            if name in found:
                raise InputError(f'--region-temperature names "{name}" twice; give it once.')
            found[name] = quantity(value, "kelvin", "--region-temperature")
        return found


def hot_part(options: PartOptions, simulation: SimulationOptions) -> PartOptions:
    """The part's options, with the wall's temperature as that of a part that has expanded."""
    if options.expansion is None or options.hot_temperature is not None:
        return options
    return evolve(options, hot_temperature=simulation.wall_temperature)
