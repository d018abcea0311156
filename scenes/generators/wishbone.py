"""Free-form wishbone, as a control arm of a car.

The solid is given by its signed distance (negative inside): two swept arms, a brace and three hubs,
joined and bored by smooth unions and differences.
"""

from __future__ import annotations

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.part.regions import Regions
from iriftrace.part.standards import check_less, check_positive

PIECES = ("arms", "brace", "ball hub", "bushes")
REGIONS = ("arms", "brace", "ball hub", "bush -x", "bush +x")

HALF_BUSH_MM = 15.0
"""Half the length of a bush."""


_ARM_FLATTENING, _BRACE_FLATTENING = 0.72, 0.7
_BRACE_RADIUS, _BRACE_HEIGHT, _BRACE_CURVATURE = 5.0, 5.0, 0.0016
_HUB = (-12.0, 14.0)
_BUSH = (-HALF_BUSH_MM, HALF_BUSH_MM)
_THROUGH = (-60.0, 60.0)
_EDGE = 1.5

_SMOOTHING_STEPS, _PASS_BAND = 30, 0.15
_MOST_POINTS = 3e7


def _smooth_union(one: FloatArray, other: FloatArray, blend: float) -> FloatArray:
    """Union whose seam is rounded over a length, mm (polynomial smooth minimum)."""
    overlap = np.maximum(blend - np.abs(one - other), 0.0)
    return np.asarray(np.minimum(one, other) - overlap**2 / (4.0 * blend))


def _rounded_cylinder(
    across: FloatArray, along: FloatArray, radius: float, ends: tuple[float, float]
) -> FloatArray:
    """Cylinder with rounded edges, at distances from its axis and places along it, mm."""
    around = across - radius + _EDGE
    beyond = np.maximum(along - ends[1], ends[0] - along) + _EDGE
    inside = np.minimum(np.maximum(around, beyond), 0.0)
    outside = np.sqrt(np.maximum(around, 0.0) ** 2 + np.maximum(beyond, 0.0) ** 2)
    return np.asarray(inside + outside - _EDGE)


@frozen
class WishboneShape:
    """Signed distance of a wishbone, symmetric about x = 0; lengths in mm."""

    bush_distance: float  # between the middles of the bushes, which lie along x
    depth: float  # from the ball hub, whose axis is z, to the bushes' axis, along y
    rise: float  # height of the arms' control points above the hubs
    thickness: float  # factor on the arms' section
    hub_radius: float
    hub_bore: float  # radius, as that of the bush
    bush_radius: float
    bush_bore: float

    @property
    def extent(self) -> tuple[tuple[float, float], ...]:
        """Lowest and highest x, y, z of a box around the solid, mm."""
        half, back = 0.5 * self.bush_distance, 0.5 * self.depth
        wide = half + HALF_BUSH_MM + 6.0
        across = back + max(self.hub_radius, self.bush_radius + 4.0) + 4.0
        low = max(-_HUB[0], self.bush_radius) + 10.0
        high = max(_HUB[1], self.bush_radius) + 5.0 + self.rise
        return (-wide, wide), (-across, across), (-low, high)

    def pieces(self, points: FloatArray) -> dict[str, FloatArray]:
        """Signed distance of each of `PIECES` at (..., 3) points, mm, bores not taken out."""
        x, y, z = np.abs(points[..., 0]), points[..., 1], points[..., 2]
        half, back = 0.5 * self.bush_distance, 0.5 * self.depth
        brace = np.hypot(y + 2.0 + _BRACE_CURVATURE * x**2, (z - _BRACE_HEIGHT) / _BRACE_FLATTENING)
        return {
            "arms": self._arms(x, y, z),
            "brace": np.maximum(brace - _BRACE_RADIUS, x - half + 25.0),
            "ball hub": _rounded_cylinder(np.hypot(x, y - back), z, self.hub_radius, _HUB),
            "bushes": _rounded_cylinder(np.hypot(y + back, z), x - half, self.bush_radius, _BUSH),
        }

    def distance(self, points: FloatArray) -> FloatArray:
        """Signed distance of the solid at (..., 3) points, mm; exact only near its surface."""
        pieces = self.pieces(points)
        solid = _smooth_union(pieces["arms"], pieces["brace"], 8.0)
        solid = _smooth_union(solid, pieces["ball hub"], 6.0)
        solid = _smooth_union(solid, pieces["bushes"], 6.0)
        x, y, z = np.abs(points[..., 0]), points[..., 1], points[..., 2]
        half, back = 0.5 * self.bush_distance, 0.5 * self.depth
        for bore in (
            _rounded_cylinder(np.hypot(x, y - back), z, self.hub_bore, _THROUGH),
            _rounded_cylinder(np.hypot(y + back, z), x - half, self.bush_bore, _THROUGH),
        ):
            solid = -_smooth_union(-solid, bore, 1.0)  # the solid without the bore
        return solid

    def _arms(self, x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
        """Sixty ellipsoids along a cubic Bezier curve from the ball hub to a bush."""
        half, back = 0.5 * self.bush_distance, 0.5 * self.depth
        share = np.linspace(0.0, 1.0, 60)
        rest = 1.0 - share
        control = np.array(
            [
                (0.0, back, 0.0),
                (34.0 / 75.0 * half, 40.0 / 44.0 * back, self.rise),
                (58.0 / 75.0 * half, 2.0 / 44.0 * back, self.rise),
                (half - 1.0, 2.0 - back, 0.0),
            ]
        )
        weights = np.stack((rest**3, 3 * rest**2 * share, 3 * rest * share**2, share**3))
        radii = self.thickness * (
            6.0 + 4.5 * rest**2 + 2.0 * share**3 - 1.2 * np.sin(np.pi * share)
        )
        nearest = np.full(np.shape(x), np.inf)
        for (px, py, pz), radius in zip(weights.T @ control, radii, strict=True):
            flat = ((z - pz) / _ARM_FLATTENING) ** 2
            distance = np.sqrt((x - px) ** 2 + (y - py) ** 2 + flat) - radius
            nearest = np.minimum(nearest, distance)
        return 0.9 * nearest


def wishbone(
    bush_distance_mm: float = 150.0,
    depth_mm: float = 88.0,
    *,
    rise_mm: float = 9.0,
    thickness: float = 1.0,
    hub_diameter_mm: float = 36.0,
    hub_bore_mm: float = 20.0,
    bush_diameter_mm: float = 28.0,
    bush_bore_mm: float = 16.0,
    spacing_mm: float = 1.25,
) -> Part:
    """Wishbone in the xy plane: a ball hub at +y, two bushes along x at -y, arms and a brace.

    The signed distance of the solid is contoured on a lattice and smoothed (Taubin).

    Parameters
    ----------
    bush_distance_mm
        Between the middles of the bushes.
    depth_mm
        From the ball hub's axis to that of the bushes.
    rise_mm
        Height of the arms' control points above the hubs' middle.
    thickness
        Factor on the arms' section.
    hub_diameter_mm
        Outer diameter of the ball hub.
    hub_bore_mm
        Its bore.
    bush_diameter_mm
        Outer diameter of the bushes.
    bush_bore_mm
        Their bore.
    spacing_mm
        Of the lattice on which the shape is contoured; triangles are about as large.

    Returns
    -------
    Part
        Regions `REGIONS`; a face belongs to the piece whose surface is nearest.

    Raises
    ------
    InputError
        The sizes make no wishbone in one piece.
    """
    shape = WishboneShape(
        bush_distance=bush_distance_mm,
        depth=depth_mm,
        rise=rise_mm,
        thickness=thickness,
        hub_radius=0.5 * hub_diameter_mm,
        hub_bore=0.5 * hub_bore_mm,
        bush_radius=0.5 * bush_diameter_mm,
        bush_bore=0.5 * bush_bore_mm,
    )
    _check_shape(shape, spacing_mm)
    vertices, faces = _contour(shape, spacing_mm)
    regions = _regions(shape, vertices[faces].mean(axis=1))
    # Centred along y and z; x is centred by the shape's own symmetry.
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    return part_of_mesh(vertices - middle * (0, 1, 1), faces, name="wishbone", regions=regions)


def _check_shape(shape: WishboneShape, spacing: float) -> None:
    """Refuse sizes that make no wishbone, or none on a lattice of this spacing, mm."""
    check_positive(
        "wishbone",
        bush_distance=shape.bush_distance,
        depth=shape.depth,
        hub_bore=2.0 * shape.hub_bore,
        bush_bore=2.0 * shape.bush_bore,
        spacing=spacing,
    )
    if not 0.5 <= shape.thickness <= 3.0:
        raise InputError(
            f"A thickness of {shape.thickness:g} times the usual one makes no wishbone; give 0.5 "
            "to 3.",
            code="scenes.size",
        )
    if not 0.0 <= shape.rise <= 50.0:
        raise InputError(
            f"A rise of {shape.rise:g} mm bends the wishbone's arms out of shape; give 0 to 50 mm.",
            code="scenes.size",
        )
    for name, bore, outer in (
        ("hub", shape.hub_bore, shape.hub_radius),
        ("bush", shape.bush_bore, shape.bush_radius),
    ):
        inner = (f"{name} bore and twice the lattice's spacing", 2.0 * (bore + spacing))
        reason = "a wall has to be left around the bore"
        check_less("wishbone", inner, (f"{name} diameter", 2.0 * outer), reason)
    check_less(
        "wishbone",
        ("lattice's spacing", spacing),
        ("thinnest arm's half width", 4.0 * shape.thickness),
        "else the lattice misses the arms",
    )
    for name, distance, least in (
        ("depth", shape.depth, shape.hub_radius + shape.bush_radius),
        ("half bush distance", 0.5 * shape.bush_distance, shape.hub_radius + HALF_BUSH_MM),
    ):
        touching = ("hubs' reach", least)
        check_less("wishbone", touching, (name, distance), "the arms need room between the hubs")


def _contour(shape: WishboneShape, spacing: float) -> tuple[FloatArray, IntArray]:
    import pyvista as pv

    size = np.prod([(high - low) / spacing for low, high in shape.extent])
    if size > _MOST_POINTS:
        raise InputError(
            f"A lattice of {spacing:g} mm has {size:.2g} points around this wishbone, more than "
            f"{_MOST_POINTS:.0e}; give a larger spacing.",
            code="scenes.too_many_points",
        )
    axes = [np.arange(low, high + 0.5 * spacing, spacing) for low, high in shape.extent]
    lattice = pv.ImageData(
        dimensions=[len(axis) for axis in axes],
        spacing=(spacing, spacing, spacing),
        origin=[axis[0] for axis in axes],
    )
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    lattice["distance"] = shape.distance(points).ravel(order="F")
    surface = lattice.contour([0.0], "distance").triangulate().clean(tolerance=1e-7)
    pieces = len(np.unique(surface.connectivity("all")["RegionId"]))
    if pieces != 1:
        raise InputError(
            f"These sizes give {pieces} separate pieces and no wishbone, because the arms do not "
            "reach the hubs; give a smaller distance or depth, or thicker arms.",
            code="scenes.pieces",
        )
    smooth = surface.smooth_taubin(n_iter=_SMOOTHING_STEPS, pass_band=_PASS_BAND)
    # VTK's triangles face towards smaller values, which lie inside.
    return np.array(smooth.points, np.float64), np.array(smooth.regular_faces, np.int64)[:, ::-1]


def _regions(shape: WishboneShape, centres: FloatArray) -> Regions:
    pieces = shape.pieces(centres)
    nearest = np.argmin([pieces[name] for name in PIECES], axis=0)
    bush = nearest == PIECES.index("bushes")
    number = np.where(bush & (centres[:, 0] > 0.0), REGIONS.index("bush +x"), nearest)
    return Regions(number.astype(np.int64), REGIONS)
