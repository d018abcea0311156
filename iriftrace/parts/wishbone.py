"""Free-form wishbone, as a control arm of a car."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iriftrace.errors import InputError
from iriftrace.part import Part, part_of_mesh
from iriftrace.parts.sizes import check_less, check_positive
from iriftrace.parts.wishbone_shape import HALF_BUSH_MM, PIECES, WishboneShape
from iriftrace.regions import Regions

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

REGIONS = ("arms", "brace", "ball hub", "bush -x", "bush +x")

_SMOOTHING_STEPS, _PASS_BAND = 30, 0.15
_MOST_POINTS = 3e7


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
    hub_diameter_mm, hub_bore_mm
        Outer and bore diameter of the ball hub.
    bush_diameter_mm, bush_bore_mm
        Outer and bore diameter of the bushes.
    spacing_mm
        Of the lattice; triangles are about as large.

    Returns
    -------
    Part
        Regions `REGIONS`; a face belongs to the piece whose surface is nearest.

    Raises
    ------
    InputError
        The sizes make no wishbone in one piece.
    """
    check_positive(
        "wishbone",
        bush_distance=bush_distance_mm,
        depth=depth_mm,
        hub_bore=hub_bore_mm,
        bush_bore=bush_bore_mm,
        spacing=spacing_mm,
    )
    if not 0.5 <= thickness <= 3.0:
        raise InputError(
            f"A thickness of {thickness:g} times the usual one makes no wishbone; give 0.5 to 3."
        )
    if not 0.0 <= rise_mm <= 50.0:
        raise InputError(
            f"A rise of {rise_mm:g} mm bends the wishbone's arms out of shape; give 0 to 50 mm."
        )
    reason = "a wall has to be left around the bore"
    wall = 2.0 * spacing_mm
    for name, bore, outer in (
        ("hub", hub_bore_mm, hub_diameter_mm),
        ("bush", bush_bore_mm, bush_diameter_mm),
    ):
        inner = (f"{name} bore and twice the lattice's spacing", bore + wall)
        check_less("wishbone", inner, (f"{name} diameter", outer), reason)
    check_less(
        "wishbone",
        ("lattice's spacing", spacing_mm),
        ("thinnest arm's half width", 4.0 * thickness),
        "else the lattice misses the arms",
    )
    for name, distance, least in (
        ("depth", depth_mm, 0.5 * (hub_diameter_mm + bush_diameter_mm)),
        ("half bush distance", 0.5 * bush_distance_mm, 0.5 * hub_diameter_mm + HALF_BUSH_MM),
    ):
        touching = ("hubs' reach", least)
        check_less("wishbone", touching, (name, distance), "the arms need room between the hubs")
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
    vertices, faces = _contour(shape, spacing_mm)
    regions = _regions(shape, vertices[faces].mean(axis=1))
    # Centred along y and z; x is centred by the shape's own symmetry.
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    return part_of_mesh(vertices - middle * (0, 1, 1), faces, name="wishbone", regions=regions)


def _contour(shape: WishboneShape, spacing: float) -> tuple[FloatArray, IntArray]:
    import pyvista as pv

    size = np.prod([(high - low) / spacing for low, high in shape.extent])
    if size > _MOST_POINTS:
        raise InputError(
            f"A lattice of {spacing:g} mm has {size:.2g} points around this wishbone, more than "
            f"{_MOST_POINTS:.0e}; give a larger spacing."
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
            "reach the hubs; give a smaller distance or depth, or thicker arms."
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
