"""Hot vertical plate in still air: the laminar boundary layer of air with its real properties.

The air's density, viscosity, conductivity and heat capacity are those of `iriftrace.medium.air`.
"""

from __future__ import annotations

import hashlib
from functools import cached_property

import numpy as np
import pyvista as pv
import trimesh
from attrs import field, frozen
from numpy.typing import ArrayLike
from scipy.integrate import solve_bvp
from scipy.interpolate import PPoly

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.medium.air import thermophysics as gas
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.source import FieldFacts, FieldKind, FieldSource
from iriftrace.part.board import Board
from iriftrace.part.part import Part, part_of_mesh

WIDTH_MM, HEIGHT_MM, THICKNESS_MM = 50.0, 100.0, 5.0
"""Size of the bundled plate along x, z and y. Its hot wall lies in y = 0, its lower edge in z = 0,
and the air at y > 0."""

BOARD_X_MM = -150.0

_CELLS, _GROWTH = 120, 1.02
_HEIGHTS_MM = np.linspace(10.0, 95.0, 35)


@frozen(eq=False)
class PlateAir:
    r"""Air at a hot vertical plate with a sharp lower edge.

    The equations of the boundary layer of a perfect gas (H. Schlichting and K. Gersten,
    Boundary-Layer Theory, 2017, chapter 10) have solutions that depend on
    :math:`\zeta = y / x^{1/4}` alone, x the height above the lower edge and y the distance from
    the wall. With the stream function :math:`x^{3/4} F(\zeta)` of the mass flow and the vertical
    velocity :math:`x^{1/2} U(\zeta)` they become

    .. math::

        F' = \rho U, \quad (\mu U')' = \rho U^2 / 2 - 3 F U' / 4 - g (\rho_a - \rho), \quad
        (k T')' = -3 F c_p T' / 4

    with F = U = 0 and the wall's temperature at 0, and still air of ambient temperature far away.
    The leading edge, where the layer is not thin against x, is not in them.

    Attributes
    ----------
    wall_k : float
        Temperature of the wall, K.
    air : Air
        Ambient air.

    Raises
    ------
    InputError
        The wall is not hotter than the air, or hotter than 5000 K.
    """

    wall_k: float
    air: Air = field(factory=Air)

    def __attrs_post_init__(self) -> None:
        """Refuse walls to which the equations or the properties do not apply."""
        ambient = self.air.temperature_k
        if not ambient + 1.0 <= self.wall_k <= 5000.0:
            raise InputError(
                f"a plate of {self.wall_k:g} K in air of {ambient:g} K cannot be computed: the "
                "wall must be at least 1 K hotter than the air and not hotter than 5000 K.",
                code="scenes.wall_temperature",
            )

    @property
    def length_mm(self) -> float:
        """Unit of length of the solution, (nu^2 / g)^(1/3) of the ambient air, mm."""
        ambient = self.air.temperature_k
        kinematic = gas.viscosity(ambient) / gas.density(ambient, self.air.pressure_pa)
        return 1e3 * float((kinematic**2 / gas.GRAVITY) ** (1.0 / 3.0))

    @cached_property
    def profile(self) -> PPoly:
        """Functions F, U, mu U', T and k T' of zeta, in units of `length_mm` and the ambient air.

        Of length, density, viscosity, temperature and heat capacity; g is 1.
        """
        ambient, ratio = self.air.temperature_k, self.wall_k / self.air.temperature_k
        mu_a, cp_a = gas.viscosity(ambient), gas.heat_capacity(ambient)

        def slopes(_: FloatArray, y: FloatArray) -> FloatArray:
            f, u, stress, t, flux = y
            kelvin = np.clip(t, 1.0, ratio) * ambient
            rho, mu = ambient / kelvin, gas.viscosity(kelvin) / mu_a
            k, cp = gas.conductivity(kelvin) / (mu_a * cp_a), gas.heat_capacity(kelvin) / cp_a
            lift = rho - 1.0
            return np.stack(
                (
                    rho * u,
                    stress / mu,
                    0.5 * rho * u**2 - 0.75 * f * stress / mu + lift,
                    flux / k,
                    -0.75 * f * cp * flux / k,
                )
            )

        def ends(wall: FloatArray, far: FloatArray) -> FloatArray:
            return np.array((wall[0], wall[1], wall[3] - ratio, far[1], far[3] - 1.0))

        # Scales of a layer in gas of constant properties, and a guess of its shape.
        thick = (4.0 / (ratio - 1.0)) ** 0.25
        e = (12.0 + 1.5 * (ratio - 1.0)) * np.linspace(0.0, 1.0, 400) ** 1.5
        fast = np.sqrt(ratio - 1.0)
        fall = np.exp(-0.6 * e)
        guess = (thick * fast * (1.0 - fall), fast * e * fall, fast * (1.0 - e) * fall / thick)
        heat = (1.0 + (ratio - 1.0) * fall, -0.8 * (ratio - 1.0) * fall / thick)
        # Beyond this tolerance the kink of the heat capacity at 1000 K takes many knots.
        found = solve_bvp(
            slopes, ends, thick * e, np.stack((*guess, *heat)), tol=1e-6, max_nodes=40_000
        )
        if not found.success:
            raise InputError(
                f"the boundary layer at {self.wall_k:g} K was not found.", code="scenes.no_solution"
            )
        return found.sol

    def thickness_mm(self, height_mm: float) -> float:
        """Distance from the wall, mm, at which the solution ends in ambient air."""
        return float(self.profile.x[-1] * height_mm**0.25 * self.length_mm**0.75)

    def temperature(self, distance_mm: ArrayLike, height_mm: ArrayLike) -> FloatArray:
        """Temperature, K, at distances from the wall and heights above the lower edge, mm."""
        distance, height = np.broadcast_arrays(distance_mm, height_mm)
        zeta = distance / (height**0.25 * self.length_mm**0.75)
        last = self.profile.x[-1]
        excess = self.profile(np.minimum(zeta, last))[3] - 1.0
        kelvin = self.air.temperature_k * (1.0 + np.where(zeta < last, excess, 0.0))
        return np.clip(kelvin, self.air.temperature_k, self.wall_k)


def hot_plate(air: PlateAir) -> tuple[Part, Part, IndexField]:
    """A board that is seen past the bundled plate, the plate, and the formula's air at a mesh.

    Lines of sight run along x, the plate's width, and the board stands across them. The mesh begins
    10 mm above the plate's lower edge.
    """
    board = Board((44.0, 120.0), 2.0).part.transformed(
        # The board's x, y and z are the world's y, z and x.
        np.array(((0, 0, 1.0, BOARD_X_MM), (1.0, 0, 0, 16.0), (0, 1.0, 0, 50.0), (0, 0, 0, 1.0)))
    )
    return board, plate_part(), plate_field(air)


def plate_part(width_mm: float = WIDTH_MM, height_mm: float = HEIGHT_MM) -> Part:
    """A plate of a size along x and z, whose hot wall lies in y = 0 and lower edge in z = 0."""
    box = trimesh.creation.box((width_mm, THICKNESS_MM, height_mm))
    box.apply_translation((0.0, -0.5 * THICKNESS_MM, 0.5 * height_mm))
    return part_of_mesh(box.vertices, box.faces, name="scenes.generators.plate")


def plate_field(
    air: PlateAir, width_mm: float = WIDTH_MM, heights_mm: FloatArray = _HEIGHTS_MM
) -> IndexField:
    """The formula's air at points of hexahedra along a width and between heights.

    On the bundled plate they are some 0.05 mm thick at the wall.
    """
    end = air.thickness_mm(heights_mm[-1])
    away = end * (_GROWTH ** np.arange(_CELLS + 1) - 1.0) / (_GROWTH**_CELLS - 1.0)
    along = width_mm * np.array((-0.5, 0.0, 0.5))
    grid = pv.StructuredGrid(*np.meshgrid(along, away, heights_mm, indexing="ij"))
    points = np.asarray(grid.points, dtype=np.float64)
    kelvin = air.temperature(points[:, 1], points[:, 2])
    source = FieldSource(
        path="scenes.generators.plate",
        # Of the formula's parameters: the last bits of its values depend on the processor.
        sha256=hashlib.sha256(repr((air.wall_k, air.air)).encode()).hexdigest(),
        array="T",
        quantity="temperature",
        length_unit="mm",
        origin="steady boundary layer of a vertical plate, similarity solution",
        facts=FieldFacts(FieldKind.STEADY),
    )
    whole = grid.cast_to_unstructured_grid()
    return IndexField(whole, air.air.refractivity(kelvin), air.air, source)
