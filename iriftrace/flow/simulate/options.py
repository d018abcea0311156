"""Options of simulations, for Python and for commands: physics, mesh and times; draughts."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Self

from attrs import field, frozen
from attrs.converters import optional as if_given

from iriftrace.core.errors import InputError, changed, refuse_given
from iriftrace.core.number_lists import Numbers
from iriftrace.core.units import (
    Duration,
    Length,
    Pressure,
    Speed,
    Temperature,
)
from iriftrace.flow.simulate.draught import Draught, draught_from
from iriftrace.io.reading import ReadPart

if TYPE_CHECKING:
    from iriftrace.flow.simulate.bodies import Body
    from iriftrace.part.wall_temperature import WallTemperatures

AMBIENT_RANGE = (200.0, 400.0)  # K
PRESSURE_RANGE = (60e3, 120e3)  # Pa
_MARGINS = (0.25, 4.0)
_MOST_PROCESSES = 1024

_OF_A_MEASURED_WALL = ("wall_length_unit", "wall_temperature_unit", "wall_above")


@frozen
class SimulationOptions:
    """Physics, mesh and times of a simulation.

    Parameters
    ----------
    wall_temperature
        Temperature of the part's wall, "1100 degC"; by default that of the hot part
        (hot-temperature).
    wall_temperature_from
        File with the temperatures of the wall: a table of x, y, z, T (.csv), such as
        points of a thermogram, or a surface with T (.vtp .vtk .vtu) of a finite element solution.
    wall_length_unit
        Unit of that file's coordinates; by default the unit that it states, else mm.
    wall_temperature_unit
        Unit of its temperatures; by default the unit that it states, else K.
    wall_above
        Leave out its temperatures below this one, such as the background of a thermogram, "400
        degC".
    region_temperature
        Another temperature for a region of the part, NAME=TEMPERATURE, or for all that match a
        pattern, "plane -x*=900 degC"; repeatable.
    transition
        Width over which one wall temperature changes into another (10 % to 90 %), "10 mm"; by
        default they meet in a line.
    ambient
        Temperature of the air far away.
    pressure
        Air pressure.
    resolution
        Fineness of the mesh.
    background_cell
        Edge of the mesh's largest cells instead of that of the resolution, "40 mm"; those at the
        wall have a sixteenth.
    symmetry
        Compute a half or a quarter and mirror it at the part's centre; the field is then exactly
        symmetric, which a real plume is not.
    body
        Another closed surface in the air, such as a table or a support; repeatable. Its unit is
        that of the part, and it may touch the part.
    body_temperature
        Temperature of the bodies' walls, "80 degC", or insulated (the default); one for all, or
        one for each in their order; repeatable.
    floor
        Height z of a floor below the part, at the temperature of the air, "-16 mm".
    margin
        Factor on the air around the part.
    end_time
        Physical time to simulate; by default 2 s, longer for large or cool parts.
    average_time
        Interval before the end over which the density is averaged; by default a quarter. A run that
        already came past its beginning averages over the rest, with a warning.
    snapshots
        Number of states from that interval to keep besides the average, as an ensemble; a run that
        already came past its beginning is refused.
    processes
        Processes for the solver.

    Raises
    ------
    InputError
        If a value is out of range, or two do not go together.
    """

    wall_temperature: Temperature | None = field(default=None, converter=if_given(Temperature))
    wall_temperature_from: Path | None = None
    wall_length_unit: str | None = None
    wall_temperature_unit: Literal["K", "degC"] | None = None
    wall_above: Temperature | None = field(default=None, converter=if_given(Temperature))
    region_temperature: list[str] | None = None
    transition: Length = field(default=Length(0.0), converter=Length)
    ambient: Temperature = field(default=Temperature("20 degC"), converter=Temperature)
    pressure: Pressure = field(default=Pressure(101325.0), converter=Pressure)
    resolution: Literal["coarse", "normal", "fine", "extra-fine"] = "normal"
    background_cell: Length | None = field(default=None, converter=if_given(Length))
    symmetry: Literal["none", "x", "y", "xy"] = "none"
    body: list[Path] | None = None
    body_temperature: list[str] | None = None
    floor: Length | None = field(default=None, converter=if_given(Length))
    margin: float = 1.0
    end_time: Duration | None = field(default=None, converter=if_given(Duration))
    average_time: Duration | None = field(default=None, converter=if_given(Duration))
    snapshots: int = 0
    processes: int = 1

    def __attrs_post_init__(self) -> None:
        for name, (low, high), what, unit in (
            ("ambient", AMBIENT_RANGE, "an ambient temperature", "K"),
            ("pressure", PRESSURE_RANGE, "an air pressure", "Pa"),
            ("margin", _MARGINS, "a margin", "times the usual air around the part"),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError(
                    f"{what} of {value:g} {unit} cannot be simulated here; give one from {low:g} "
                    f"to {high:g}.",
                    code="case.out_of_range",
                    argument=name,
                )
        if not 1 <= self.processes <= _MOST_PROCESSES:
            raise InputError(
                f"the solver cannot run as {self.processes} processes; give a number from 1 to "
                f"{_MOST_PROCESSES}.",
                code="case.processes",
                argument="processes",
            )
        names: tuple[str, ...] = _OF_A_MEASURED_WALL
        reason = "is about the file of the wall's temperatures, which is not given; leave it out."
        if self.wall_temperature_from is not None:
            names = ("wall_temperature", "region_temperature", "transition")
            reason = (
                "is given besides a file with the temperatures of the whole wall; leave one out."
            )
        refuse_given(changed(self, names), reason, "wall.two_temperatures")
        count, bodies = len(self.body_temperature or ()), len(self.body or ())
        if count and (not bodies or count not in (1, bodies)):
            raise InputError(
                f"the temperature of bodies is given {count} times for {bodies} bodies; give it "
                "once for all of them, or once for each.",
                code="body.temperatures",
                argument="body_temperature",
            )

    def wall(self) -> WallTemperatures:
        """Temperatures of the part's wall; regions may be patterns."""
        from iriftrace.io.measured import read_measured_wall
        from iriftrace.part.wall_temperature import (
            WallTemperatures,
            measured_wall,
            region_temperatures,
        )

        if self.wall_temperature_from is not None:
            units = self.wall_length_unit, self.wall_temperature_unit
            return measured_wall(
                read_measured_wall(self.wall_temperature_from, *units, self.wall_above)
            )
        if self.wall_temperature is None:
            raise InputError(
                'the part has no temperature; give one, "1100 degC", or a file with the '
                "temperatures of its wall.",
                code="wall.no_temperature",
                argument="wall_temperature",
            )
        regions = region_temperatures(self.region_temperature or (), "region_temperature")
        return WallTemperatures(float(self.wall_temperature), regions, float(self.transition))

    def bodies(self, length_unit: str) -> tuple[Body, ...]:
        """Bodies in the air besides the part, read in its unit."""
        from iriftrace.flow.simulate.bodies import Body
        from iriftrace.io.part_files import read_part

        files = self.body or []
        kelvins = [
            None if text == "insulated" else float(Temperature(text))
            for text in self.body_temperature or ["insulated"]
        ]
        if len(kelvins) == 1:
            kelvins *= len(files)
        return tuple(
            Body(read_part(file, ReadPart(length_unit=length_unit)), kelvin)
            for file, kelvin in zip(files, kelvins, strict=True)
        )

    @property
    def mirrors(self) -> str:
        """Axes of "xy" at whose centre plane the field is mirrored."""
        return "" if self.symmetry == "none" else self.symmetry


class Speeds(tuple[float, ...]):
    """Speeds, m/s; in a text START:STOP:STEP, whose last is STOP if whole steps lead there."""

    def __new__(cls, value: str | Iterable[str | float]) -> Self:
        if isinstance(value, str):
            return super().__new__(cls, _stepped(value))
        return super().__new__(cls, (float(Speed(speed)) for speed in value))

    def __str__(self) -> str:
        return ", ".join(f"{speed:g} m/s" for speed in self)


def _stepped(text: str) -> list[float]:
    try:
        start, stop, step = map(float, text.strip().removesuffix("m/s").split(":"))
        count = (stop - start) / step
        if not (step > 0.0 and 0.0 <= count < 1000.0):
            raise ValueError
    except (ValueError, ZeroDivisionError):
        raise InputError(
            f'"{text}" are not speeds; write START:STOP:STEP, where START is not above STOP, STEP '
            "is positive and at most 1000 steps lie between them.",
            code="family.no_speeds",
            argument="draughts",
        ) from None
    # Rounded, so that three steps of 0.1 are 0.3.
    return [round(start + number * step, 9) for number in range(int(count + 1e-6) + 1)]


@frozen
class DraughtOptions:
    """Wind around the part.

    Parameters
    ----------
    draught
        Speed of a draught, "0.2 m/s"; needs draught-from.
    draughts
        Speeds of a family, START:STOP:STEP in m/s, such as 0:0.2:0.02; each is solved from each of
        the directions.
    draught_from
        Where the air comes from: degrees in the horizontal plane (0 is +x, 90 is +y), or X,Y,Z. For
        a family the angles, 0,90,180,270.
    between
        Add members halfway between neighbouring speeds and directions (at most 30 degrees apart) of
        a family. They are not solved: the plumes of those around them are moved to one place and
        averaged.

    Raises
    ------
    InputError
        If these do not go together.
    """

    draught: Speed | None = field(default=None, converter=if_given(Speed))
    draughts: Speeds | None = field(default=None, converter=if_given(Speeds))
    draught_from: Numbers | None = field(default=None, converter=if_given(Numbers))
    between: bool = False

    def __attrs_post_init__(self) -> None:
        if self.draughts is not None:
            reason = "is the speed of one draught, but there are those of a family; leave one out."
            refuse_given(changed(self, ("draught",)), reason, "draught.two_speeds")
            return
        reason = "is for the members of a family; give the speeds of its draughts, or leave it out."
        refuse_given(changed(self, ("between",)), reason, "family.no_speeds")
        if self.draught is None:
            reason = "is the direction of a draught without a speed; give that, or leave it out."
            refuse_given(changed(self, ("draught_from",)), reason, "draught.no_speed")
        elif self.draught_from is None:
            raise InputError(
                f"the draught of {self.draught!s} has no direction; say where it comes from, 90 "
                "(degrees, 0 is +x) or X,Y,Z.",
                code="draught.no_direction",
                argument="draught_from",
            )

    def single(self) -> Draught | None:
        """The draught of one simulation; None in still air."""
        if self.draught is None:
            return None
        return draught_from(float(self.draught), self.draught_from or ())
