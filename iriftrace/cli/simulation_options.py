"""Options of ``iriftrace field simulate``: the case that they describe, and its draughts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from attrs import evolve, frozen
from cyclopts import Group, Parameter

from iriftrace.cli.options import (
    Duration,
    Flag,
    Length,
    Numbers,
    Pressure,
    Speed,
    Temperature,
    Whole,
    numbers,
    quantity,
    refuse_given,
    region_temperatures,
)
from iriftrace.core.errors import InputError
from iriftrace.core.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    from iriftrace.flow.simulate.bodies import Body
    from iriftrace.flow.simulate.case import Case
    from iriftrace.flow.simulate.draught import Draught
    from iriftrace.part.part import Part
    from iriftrace.part.wall_temperature import WallTemperatures


@Parameter(name="*", group=Group("Simulation", sort_key=1))
@frozen
class SimulationOptions:
    """Physics, mesh and times of a simulation.

    Parameters
    ----------
    wall_temperature
        Temperature of the part's wall, "1100 degC"; by default --hot-temperature.
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
        Interval before the end over which the density is averaged; by default a quarter.
    snapshots
        Number of states from that interval to keep besides the average, as an ensemble.
    """

    wall_temperature: Temperature | None = None
    wall_temperature_from: Path | None = None
    wall_length_unit: str | None = None
    wall_temperature_unit: Literal["K", "degC"] | None = None
    wall_above: Temperature | None = None
    region_temperature: list[str] | None = None
    transition: Length = 0.0
    ambient: Temperature = 20.0 + ZERO_CELSIUS_K
    pressure: Pressure = 101325.0
    resolution: Literal["coarse", "normal", "fine", "extra-fine"] = "normal"
    background_cell: Length | None = None
    symmetry: Literal["none", "x", "y", "xy"] = "none"
    body: list[Path] | None = None
    body_temperature: list[str] | None = None
    floor: Length | None = None
    margin: float = 1.0
    end_time: Duration | None = None
    average_time: Duration | None = None
    snapshots: Whole = 0

    def case(
        self,
        part: Part,
        processes: int,
        draught: Draught | None,
        mirrors: str | None = None,
        family: Sequence[Draught] = (),
    ) -> Case:
        """The case that these options describe in a draught, mirrored by them or at `mirrors`.

        Its mesh is also fine enough for the draughts of its `family`.
        """
        from iriftrace.flow.simulate.case import natural_case
        from iriftrace.part.region_choice import values_by_region

        wall = self.wall()
        return natural_case(
            part,
            evolve(wall, regions=values_by_region(part, wall.regions)),
            resolution=self.resolution,
            background_mm=self.background_cell,
            end=self.end_time,
            averaging=self.average_time,
            snapshots=self.snapshots,
            ambient_k=self.ambient,
            pressure_pa=self.pressure,
            mirrors=self.mirrors if mirrors is None else mirrors,
            margin=self.margin,
            processes=processes,
            draught=draught,
            bodies=self.bodies(part.length_unit),
            floor=self.floor,
            family=tuple(family),
        )

    def wall(self) -> WallTemperatures:
        """Temperatures of the part's wall."""
        from iriftrace.io.measured import read_measured_wall
        from iriftrace.part.wall_temperature import WallTemperatures, measured_wall

        regions = region_temperatures(self.region_temperature)
        file = self.wall_temperature_from
        if file is not None:
            others = {
                "--wall-temperature": self.wall_temperature,
                "--region-temperature": self.region_temperature,
                "--transition": self.transition or None,
            }
            refuse_given(
                others,
                "and --wall-temperature-from cannot both be given, since the file has the "
                "temperatures of the whole wall; leave one out.",
            )
            units = self.wall_length_unit, self.wall_temperature_unit
            return measured_wall(read_measured_wall(file, *units, self.wall_above))
        refuse_given(
            {
                "--wall-length-unit": self.wall_length_unit,
                "--wall-temperature-unit": self.wall_temperature_unit,
                "--wall-above": self.wall_above,
            },
            "is about the file of --wall-temperature-from, which is not given; leave it out.",
        )
        if self.wall_temperature is None:
            raise InputError(
                'the part has no temperature; give --wall-temperature "1100 degC", or a file with '
                "--wall-temperature-from."
            )
        return WallTemperatures(self.wall_temperature, regions, self.transition)

    def bodies(self, length_unit: str) -> tuple[Body, ...]:
        """Bodies in the air besides the part, read in its unit."""
        from iriftrace.flow.simulate.bodies import Body
        from iriftrace.io.part_files import read_part

        files = self.body or []
        kelvins = [
            None if text == "insulated" else quantity(text, "kelvin", "--body-temperature")
            for text in self.body_temperature or ["insulated"]
        ]
        if len(kelvins) == 1:
            kelvins *= len(files)
        if len(kelvins) != len(files) or (self.body_temperature and not files):
            raise InputError(
                f"--body-temperature is given {len(self.body_temperature or ())} times for "
                f"{len(files)} bodies (--body); give it once for all of them, or once for each."
            )
        return tuple(
            Body(read_part(file, length_unit=length_unit), kelvin)
            for file, kelvin in zip(files, kelvins, strict=True)
        )

    @property
    def mirrors(self) -> str:
        """Axes across which the field is mirrored."""
        return "" if self.symmetry == "none" else self.symmetry


@Parameter(name="*", group=Group("Draught", sort_key=2))
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
    scheduler
        Let worker processes solve the members of a family: "local" starts them here,
        "tcp://host:8786" is the address that `dask scheduler` prints; its workers need OpenFOAM and
        must see the folder under the same path.
    workers
        Number of local workers; by default one for every two cores, at least two.
    """

    draught: Speed | None = None
    draughts: str | None = None
    draught_from: Numbers | None = None
    between: Flag = False
    scheduler: str | None = None
    workers: Whole | None = None

    @property
    def address(self) -> str | None:
        """Scheduler of the workers; None if the members are solved in this process."""
        return "local" if self.scheduler is None and self.workers is not None else self.scheduler

    def check(self, *, field: Path | None, write_only: bool, vary: str | None) -> None:
        """Refuse options that do not go together, and an invalid scheduler."""
        if self.draughts is None:
            refuse_given(
                {
                    "--scheduler": self.scheduler,
                    "--workers": self.workers,
                    "--between": self.between or None,
                },
                "is for the members of a family; give --draughts 0:0.2:0.02, or leave it out.",
            )
            return
        refuse_given(
            {"--field": field, "--write-only": write_only or None, "--vary": vary},
            "is for one field, but --draughts makes a family; leave one of them out.",
        )
        if self.address is not None:
            from iriftrace.sweep.workers import check_scheduler

            check_scheduler(self.address, self.workers)

    def single(self) -> Draught | None:
        """The draught of one simulation; None in still air."""
        from iriftrace.flow.simulate.draught import check_speed, draught_from

        if self.draught is None:
            refuse_given(
                {"--draught-from": self.draught_from},
                'is the direction of a draught without a speed; give --draught "0.2 m/s", or leave '
                "it out.",
            )
            return None
        check_speed(self.draught)
        if self.draught_from is None:
            raise InputError(
                f"--draught {self.draught:g} m/s has no direction; state where it comes from with "
                "--draught-from 90 (degrees, 0 is +x) or --draught-from X,Y,Z."
            )
        return draught_from(self.draught, self.draught_from)

    def family(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Speeds, m/s, and directions, degrees, of a family; raises InputError if invalid."""
        from iriftrace.flow.simulate.family import check_family

        refuse_given(
            {"--draught": self.draught}, "and --draughts cannot both be given; leave one out."
        )
        speeds = _speeds(self.draughts or "")
        directions = tuple(self.draught_from or ())
        check_family(speeds, directions)
        return speeds, directions


def _speeds(text: str) -> tuple[float, ...]:
    """Speeds of START:STOP:STEP, m/s; the last is STOP if whole steps lead there."""
    start, stop, step = numbers(text.strip().removesuffix("m/s"), 3, "--draughts", ":")
    count = (stop - start) / step if step else -1.0
    if not (step > 0.0 and 0.0 <= count < 1000.0):
        raise InputError(
            f'--draughts is "{text}", which are not speeds; START must not be above STOP, STEP '
            "positive and at most 1000 steps must lie between them."
        )
    # Rounded, so that three steps of 0.1 are 0.3.
    return tuple(round(start + number * step, 9) for number in range(int(count + 1e-6) + 1))
