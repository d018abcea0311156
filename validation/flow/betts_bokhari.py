"""Tall cavity of Betts and Bokhari (2000): rays through the measured temperatures, and a solver's.

The measured profiles and the case come with OpenFOAM's tutorial ``buoyantCavity``.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyvista as pv
import trimesh
from attrs import frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import SetupError
from iriftrace.core.units import ZERO_CELSIUS_K
from iriftrace.flow.simulate.programs import Installation, find_openfoam, run_program, tail
from iriftrace.io.field import read_field
from iriftrace.medium.air.refractivity import Air
from iriftrace.part.part import Part, part_of_mesh
from validation.flow.simulated import bent
from validation.flow.table import Table, per_cent

WIDTH_MM, HEIGHT_MM, DEPTH_MM = 76.0, 2180.0, 520.0
COLD_C, HOT_C = 15.0, 34.6
HEIGHTS = (10, 30, 50, 70, 90)
"""Heights of the evaluations, % of the cavity's height."""
FITTED_MM = 2.2
"""Points at most this far from a wall give its temperature and gradient."""
RAYS_MM = np.linspace(0.5, 2.0, 31)
"""Distances from a wall at which rays start; their mean deflection is compared."""
ENGINE_BOUND = 10.0
"""Per cent, at mid-height: two walls of the experiment differ by as much there."""

TUTORIAL = "heatTransfer/*/buoyantCavity"
SOLVER = "buoyantSimpleFoam"
GET = (
    "install it with `sudo apt-get install openfoam-examples`, or `apt-get download "
    "openfoam-examples`, unpack that with `dpkg -x` and set FOAM_TUTORIALS to its folder "
    "usr/share/doc/openfoam-examples/examples"
)

TEXT = f"""\
Mean temperatures that Betts and Bokhari measured in air between vertical walls at {COLD_C:g} and
{HOT_C:g} °C, {WIDTH_MM:g} mm apart, {HEIGHT_MM:g} mm high and {DEPTH_MM:g} mm deep (Int. J. Heat
and Fluid Flow 21, 2000, 675-683; Ra 860,000, turbulent), by the height as a fraction of the
cavity's. They come with OpenFOAM's tutorial `buoyantCavity`, which Debian's package
`openfoam-examples` contains; without it this section keeps its text.

The measured gradient at a wall is that of a line through the points within {FITTED_MM:g} mm, of
which the standard uncertainty is given. It states the deflection of rays along the depth that start
{RAYS_MM[0]:g} to {RAYS_MM[-1]:g} mm from the wall, towards denser air (101325 Pa, 633 nm). The
engine traces the same rays through a field file of the measured points themselves, where the
scatter of single points counts; the mean of {len(RAYS_MM)} rays is compared. The two walls are
alike if the cavity is turned upside down, apart from the air's properties: its conductivity
explains 5 to 6 % of the differences between their gradients, the rest is how certain the
measurement is, some 10 %. At mid-height the engine has to be within that.

The last rows are the tutorial's own case (`{SOLVER}`, k-omega SST, 35 x 150 x 15 cells; two minutes
on one core) against the measured points: root mean square over the width and the largest
difference. Its air starts at the mean temperature of the walls, since 1000 iterations from the
tutorial's own 20 °C end with air that is 2 K too cold. Its cells of 2.2 mm do not resolve the
gradient at the wall, which is therefore not compared."""


@frozen(eq=False)
class Wall:
    """Line through the measured points next to a wall, by the distance from it."""

    celsius: float
    slope: float  # away from the wall, K/mm
    uncertainty: float  # standard, of the slope, K/mm

    def deflection(self, air: Air) -> float:
        """Mean angle of the rays along the depth, mrad, away from the wall."""
        ends = RAYS_MM[[0, -1]]
        kelvin = self.celsius + ZERO_CELSIUS_K + self.slope * ends
        return float(1e3 * DEPTH_MM * np.diff(air.refractivity(kelvin))[0] / np.ptp(ends))


def tutorial(installation: Installation) -> Path:
    """Folder of the case ``buoyantCavity``; raises SetupError if it is nowhere."""
    environment = os.environ | installation.environment
    for tutorials in (
        environment.get("FOAM_TUTORIALS", ""),
        f"{installation.folder}/tutorials",
        "/usr/share/doc/openfoam-examples/examples",
    ):
        if found := sorted(Path(tutorials or os.devnull).glob(TUTORIAL)):
            return found[0]
    raise SetupError(
        f"OpenFOAM's tutorial buoyantCavity with the measured temperatures is missing; {GET}.",
        code="validation.no_tutorial",
    )


def measured(case: Path, height: int) -> FloatArray:
    """Rows of the distance from the cold wall, mm, and the temperature, degC, at a height, %."""
    return np.loadtxt(case / "validation" / "exptData" / f"mt_z0_{height}_lo.dat")


def wall(distances: FloatArray, celsius: FloatArray) -> Wall:
    """Least-squares line through the points within `FITTED_MM`."""
    near = distances < FITTED_MM
    line, covariance = np.polyfit(distances[near], celsius[near], 1, cov=True)
    return Wall(float(line[1]), float(line[0]), float(np.sqrt(covariance[0, 0])))


def walls(profile: FloatArray) -> tuple[Wall, Wall]:
    """The cold and the hot wall of a measured profile."""
    x, celsius = profile.T
    return wall(x, celsius), wall(WIDTH_MM - x, celsius)


def traced(profile: FloatArray, file: Path, air: Air) -> FloatArray:
    """Mean deflections away from the cold and the hot wall, mrad, in a field of measured points.

    The field is written to a file and read from there. At the walls it has the temperatures of
    the lines.
    """
    cold, hot = walls(profile)
    x = np.concatenate(([0.0], profile[:, 0], [WIDTH_MM]))
    kelvin = ZERO_CELSIUS_K + np.concatenate(([cold.celsius], profile[:, 1], [hot.celsius]))
    along = (0.5 * DEPTH_MM + 2.0) * np.array((-1.0, 0.0, 1.0))
    across = np.array((-10.0, 0.0, 10.0))
    grid = pv.StructuredGrid(*np.meshgrid(along, x, across, indexing="ij"))
    grid.point_data["T"] = np.interp(np.asarray(grid.points)[:, 1], x, kelvin)
    file.parent.mkdir(parents=True, exist_ok=True)
    grid.cast_to_unstructured_grid().save(file)
    away = np.concatenate((RAYS_MM, WIDTH_MM - RAYS_MM))
    starts = np.column_stack(np.broadcast_arrays(-0.5 * DEPTH_MM, away, 0.0))
    angles = 1e3 * bent(read_field(file, air=air), _two_walls(), starts, DEPTH_MM)[:, 0]
    return angles.reshape(2, -1).mean(axis=1) * (1.0, -1.0)


def _two_walls() -> Part:
    """Walls of the cavity, which rays must not pass."""
    boxes = []
    for y in (-0.5, WIDTH_MM + 0.5):
        box = trimesh.creation.box((DEPTH_MM + 4.0, 1.0, 20.0))
        box.apply_translation((0.0, y, 0.0))
        boxes.append(box)
    both = trimesh.util.concatenate(boxes)
    return part_of_mesh(both.vertices, both.faces, name="walls")


def solved(case: Path, installation: Installation, folder: Path) -> Iterator[FloatArray]:
    """Temperatures of the solver at the points measured at each height, degC."""
    if not tail(folder / f"log.{SOLVER}").rstrip().endswith("End"):
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(case, folder)
        start = folder / "0" / "T"
        kelvin = 0.5 * (COLD_C + HOT_C) + ZERO_CELSIUS_K
        text = re.sub(r"(internalField\s+uniform) [^;]+", rf"\g<1> {kelvin}", start.read_text())
        start.write_text(text)
        run_program(installation, folder, "blockMesh")
        run_program(installation, folder, SOLVER)
    (folder / "case.foam").touch()
    reader = pv.OpenFOAMReader(str(folder / "case.foam"))
    reader.set_active_time_value(reader.time_values[-1])
    cells = reader.read()["internalMesh"]
    x, y, z = np.asarray(cells.cell_centers().points).T * 1e3
    middle = np.abs(z) < 1.0
    for height in HEIGHTS:
        # The heights lie between two rows of cells.
        nearest = np.abs(y - 0.01 * height * HEIGHT_MM)
        rows = middle & (nearest < nearest[middle].min() + 0.1)
        places, index = np.unique(x[rows].round(3), return_inverse=True)
        means = np.bincount(index, cells["T"][rows]) / np.bincount(index)
        yield np.interp(
            measured(case, height)[:, 0],
            np.concatenate(([0.0], places, [WIDTH_MM])),
            np.concatenate(([COLD_C], means - ZERO_CELSIUS_K, [HOT_C])),
        )


def table(folder: Path) -> Table:
    """Deflections at the measured walls, the experiment's symmetry, and the solver's profiles."""
    installation = find_openfoam()
    case, folder = tutorial(installation), folder / "betts_bokhari"
    air = Air(temperature_k=COLD_C + ZERO_CELSIUS_K)
    result = Table([f"{height} %" for height in HEIGHTS])
    profiles = [measured(case, height) for height in HEIGHTS]
    pairs = [walls(profile) for profile in profiles]
    angles = np.array(
        [
            traced(profile, folder / f"measured_{height}.vtu", air)
            for height, profile in zip(HEIGHTS, profiles, strict=True)
        ]
    )
    bounds = np.where(np.array(HEIGHTS) == 50, ENGINE_BOUND, np.inf)
    for name, side in {"cold": 0, "hot": 1}.items():
        lines = [pair[side] for pair in pairs]
        result.expected(f"{name} wall: measured dT/dx, K/mm", [abs(line.slope) for line in lines])
        certain = [line.uncertainty / abs(line.slope) for line in lines]
        result.expected("standard uncertainty of the line, %", 100.0 * np.array(certain), 2)
        expected = np.array([line.deflection(air) for line in lines])
        result.expected("deflection by the line, mrad", np.abs(expected))
        result.difference(
            f"{name} wall: engine on the measured points",
            per_cent(angles[:, side], expected),
            bounds,
        )
    cold, hot = np.array([[line.slope for line in pair] for pair in pairs]).T
    result.difference(
        "cold wall's dT/dx against the hot wall's, turned", per_cent(cold, -hot[::-1])
    )
    off = [
        found - profile[:, 1]
        for found, profile in zip(
            solved(case, installation, folder / "case"), profiles, strict=True
        )
    ]
    result.expected(
        "solver's T against the measured, rms, K", [np.sqrt(np.mean(k**2)) for k in off], 2
    )
    result.expected("largest, K", [k[np.argmax(np.abs(k))] for k in off], 2)
    return result
