"""Measured profiles at vertical plates, copied in by a person, against the similarity solution.

A table is a CSV file in ``validation/data/measured``; lines that begin with # are comments. Each
row is a measured point: the plate, the distance from the wall, and a temperature or a deflection
with its expanded uncertainty U (95 %), which includes that of the place.
"""

from __future__ import annotations

import csv
from itertools import groupby
from pathlib import Path

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.units import ZERO_CELSIUS_K
from iriftrace.medium.air import thermophysics as gas
from iriftrace.medium.air.refractivity import Air
from scenes.generators.plate import PlateAir, plate_field, plate_part
from validation.flow.simulated import bent
from validation.flow.table import Table
from validation.oracles.hot_plate import profile

FOLDER = Path(__file__).parents[1] / "data" / "measured"

_PLATE = ("height_mm", "wall_C", "ambient_C", "pressure_hPa")
_RAYS = ("width_mm", "wavelength_nm")
TEMPERATURES = (*_PLATE, "distance_mm", "temperature_C", "U_K")
DEFLECTIONS = (*_PLATE, *_RAYS, "distance_mm", "deflection_mrad", "U_mrad")
"""Columns of a table of either quantity."""

LAMINAR_GRASHOF = 1e9
"""Local Grashof number beyond which the boundary layer is turbulent."""

TEXT = """\
Profiles that others measured at isothermal vertical plates. Their numbers stand in publications
that may not be copied into this repository; a person who has one copies its numbers into the table
in `validation/data/measured` that names it, where the columns and the place in the paper are
stated. Each point has an expanded uncertainty U (95 %), of its distance from the wall too. Compared
are the similarity solution ([above](#rays-along-a-hot-vertical-plate)) and, for deflections, rays
that the engine traces along the plate's width through the formula's air: root mean square of the
differences over U, at most 1, for each plate temperature and height. Beyond a Grashof number of
10⁹ of the height the layer is turbulent and the solution no longer that of the
plate, so that the differences are stated without a bound."""


@frozen(eq=False)
class Measured:
    """Points measured in one profile."""

    height_mm: float
    wall_c: float
    air: Air
    width_mm: float | None  # along the rays; None of temperatures
    distances_mm: FloatArray
    values: FloatArray  # degC, or mrad away from the wall
    expanded: FloatArray  # U, K or mrad

    @property
    def grashof(self) -> float:
        """Local Grashof number with the properties at the film temperature."""
        ambient, excess = self.air.temperature_k, self.wall_c + ZERO_CELSIUS_K
        excess -= ambient
        film = ambient + 0.5 * excess
        kinematic = float(gas.viscosity(film) / gas.density(film, self.air.pressure_pa))
        return gas.GRAVITY * excess / film * (1e-3 * self.height_mm) ** 3 / kinematic**2

    def by_solution(self) -> FloatArray:
        """Values of the similarity solution at the points."""
        layer = profile(self.wall_c + ZERO_CELSIUS_K, self.height_mm, self.air)
        if self.width_mm is None:
            return layer.kelvin(np.minimum(self.distances_mm, layer.end_mm)) - ZERO_CELSIUS_K
        width = self.width_mm
        return np.array([1e3 * layer.bending(start, width) for start in self._starts_mm])

    def by_engine(self, width_mm: float) -> FloatArray:
        """Deflections by the cells engine in the formula's air along a width, mrad."""
        heights = self.height_mm * np.linspace(0.9, 1.1, 9)
        air = PlateAir(self.wall_c + ZERO_CELSIUS_K, self.air)
        starts = np.column_stack(
            np.broadcast_arrays(-0.5 * width_mm, self._starts_mm, self.height_mm)
        )
        plate = plate_part(width_mm, 1.1 * self.height_mm)
        return 1e3 * bent(plate_field(air, width_mm, heights), plate, starts, width_mm)[:, 0]

    @property
    def _starts_mm(self) -> FloatArray:
        """Starts of rays, which would touch the wall at 0."""
        return np.maximum(self.distances_mm, 1e-3)


def read_table(file: Path) -> list[Measured]:
    """The profiles of a table, none if it has no rows yet.

    Raises InputError if its columns are not `TEMPERATURES` or `DEFLECTIONS`, or a value is no
    number or no possible one.
    """
    lines = file.read_text(encoding="utf-8").splitlines()
    rows = [(at, row) for at, row in enumerate(csv.reader(lines), 1) if _counts(row)]
    names = tuple(word.strip() for word in rows[0][1]) if rows else ()
    if names not in (TEMPERATURES, DEFLECTIONS):
        raise InputError(
            f"{file} has the columns {', '.join(names) or 'none'}, which are not those of a "
            f"measured profile; use {', '.join(TEMPERATURES)} or {', '.join(DEFLECTIONS)}.",
            code="validation.columns",
        )
    values = [_numbers(row, names, f"{file}, line {at}") for at, row in rows[1:]]
    plates = len(names) - 3
    return [
        _profile(dict(zip(names, plate, strict=False)), np.array([p[plates:] for p in points]))
        for plate, points in groupby(sorted(values), lambda point: point[:plates])
    ]


def _counts(row: list[str]) -> bool:
    return any(row) and not row[0].lstrip().startswith("#")


def _numbers(row: list[str], names: tuple[str, ...], place: str) -> tuple[float, ...]:
    try:
        values = [float(word) for word in row]
    except ValueError:
        values = []
    if len(values) != len(names) or not np.isfinite(values).all():
        raise InputError(
            f"{place}: {','.join(row)!r} is not {len(names)} numbers; complete the row.",
            code="validation.row",
        )
    by_name = dict(zip(names, values, strict=True))
    wrong = [name for name in names if name.endswith("_mm") and by_name[name] < 0.0]
    wrong += [name for name in (names[-1], "height_mm") if by_name[name] <= 0.0]
    if wrong:
        raise InputError(
            f"{place}: {wrong[0]} is {by_name[wrong[0]]:g}, which cannot be; state the paper's "
            "value and, where it has no uncertainty, your own estimate.",
            code="validation.impossible",
        )
    return tuple(values)


def _profile(plate: dict[str, float], points: FloatArray) -> Measured:
    wavelength = plate.get("wavelength_nm", Air().wavelength_nm)
    kelvin = plate["ambient_C"] + ZERO_CELSIUS_K
    return Measured(
        plate["height_mm"],
        plate["wall_C"],
        Air(wavelength, kelvin, 100.0 * plate["pressure_hPa"]),
        plate.get("width_mm"),
        *points.T,
    )


def table(folder: Path = FOLDER) -> Table:
    """Differences of all tables in a folder over their uncertainty."""
    result = Table(
        ("points", "Gr", "mean difference", "solution: rms over U", "engine: rms over U")
    )
    for file in sorted(folder.glob("*.csv")):
        profiles = read_table(file)
        if not profiles:
            result.row(file.stem, ("not filled", "", "", "", ""))
        for measured in profiles:
            _compare(result, file.stem, measured)
    return result


def _compare(result: Table, table_name: str, measured: Measured) -> None:
    name = f"{table_name}: {measured.wall_c:g} °C, height {measured.height_mm:g} mm"
    solution, unit = measured.by_solution(), "K"
    computed = {"solution": solution}
    if measured.width_mm is not None:
        computed["engine"], unit = measured.by_engine(measured.width_mm), "mrad"
    laminar = measured.grashof <= LAMINAR_GRASHOF
    cells = []
    for source, values in computed.items():
        over = float(np.sqrt(np.mean(((measured.values - values) / measured.expanded) ** 2)))
        text = f"{over:.2f}"
        if laminar and not over <= 1.0:
            result.beyond.append(f"{name}, {source}: {text} of U, at most 1")
            text = f"**{text}**"
        cells.append(text if laminar else f"{text} (turbulent)")
    mean = f"{np.mean(measured.values - solution):+.3g} {unit}"
    counts = (str(len(measured.values)), f"{measured.grashof:.1e}", mean)
    result.row(name, (*counts, *cells, *[""] * (2 - len(cells))))
