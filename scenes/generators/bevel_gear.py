"""Straight bevel gear with involute teeth, hub and bore."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from attrs import frozen
from numpy.typing import ArrayLike

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.part.regions import Regions
from iriftrace.part.standards import (
    between_rings,
    check_count,
    check_less,
    check_positive,
    circle,
)

REGIONS = ("teeth", "front", "back", "hub", "bore")
TOOTH = "tooth"
"""Name of the region that one tooth becomes."""

_ADDENDUM, _DEDENDUM = 1.0, 1.25
"""Height of a tooth above and below the pitch cone, in modules, along the back cone."""

_BORE_ROWS, _FACE_ROWS, _TOOTH_ROWS, _HUB_ROWS = 8, 3, 10, 3

FLANK_POINTS, TIP_STEPS, ROOT_STEPS = 10, 4, 4
PER_TOOTH = 2 * FLANK_POINTS + TIP_STEPS + ROOT_STEPS - 2
"""Points of the outline of one tooth with the gap after it."""

_WIDER_ROOT = 0.10
"""Share of half a tooth's pitch by which a flank is wider at the root, in place of a fillet."""


@frozen(slots=False)
class Involute:
    """Outline of a gear's teeth in the plane across its axis.

    The flanks are involutes of the base circle (radius of the pitch circle times the cosine of the
    pressure angle) from the pitch circle to the tip. Below the pitch circle they widen towards the
    root, and below the base circle they are radial besides. Lengths in mm, angles in rad.
    """

    teeth: int
    pitch_radius: float
    root_radius: float
    tip_radius: float
    pressure_angle: float

    @property
    def base_radius(self) -> float:
        """Radius of the circle of which the flanks are involutes, mm."""
        return self.pitch_radius * float(np.cos(self.pressure_angle))

    def half_angle(self, radius: ArrayLike) -> FloatArray:
        """Half the angle, rad, that a tooth takes at given radii, mm."""
        r = np.asarray(radius, dtype=np.float64)
        half_pitch = np.pi / (2 * self.teeth)
        rolled = np.arccos(np.clip(self.base_radius / r, 0.0, 1.0))
        # The involute function is tan a - a.
        half = half_pitch + np.tan(self.pressure_angle) - self.pressure_angle
        half = half - (np.tan(rolled) - rolled)
        depth = (self.pitch_radius - r) / (self.pitch_radius - self.root_radius)
        wider = _WIDER_ROOT * half_pitch * np.clip(depth, 0.0, 1.0) ** 2
        return np.asarray(half + wider)

    @cached_property
    def points(self) -> FloatArray:
        """(teeth * PER_TOOTH, 2) array: radius, mm, and angle, rad, counter-clockwise.

        Tooth k is symmetric about the angle 2 pi k / teeth and holds the points from k PER_TOOTH
        on: flank upwards, tip, flank downwards, root of the gap after it.
        """
        radii = np.linspace(self.root_radius, self.tip_radius, FLANK_POINTS)
        half = self.half_angle(radii)
        pitch = 2.0 * np.pi / self.teeth
        tip = np.linspace(-half[-1], half[-1], TIP_STEPS + 1)[1:-1]
        root = half[0] + np.linspace(0.0, 1.0, ROOT_STEPS + 1)[1:-1] * (pitch - 2.0 * half[0])
        angle = np.concatenate((-half, tip, half[::-1], root))
        on_tip, in_root = np.full_like(tip, radii[-1]), np.full_like(root, radii[0])
        radius = np.concatenate((radii, on_tip, radii[::-1], in_root))
        turns = pitch * np.repeat(np.arange(self.teeth), len(radius))
        return np.column_stack((np.tile(radius, self.teeth), np.tile(angle, self.teeth) + turns))


def bevel_gear(
    teeth: int = 20,
    module_mm: float = 2.895,
    *,
    pitch_angle_deg: float = 45.0,
    pressure_angle_deg: float = 20.0,
    face_width_mm: float | None = None,
    bore_diameter_mm: float = 18.0,
    hub_diameter_mm: float = 40.0,
    hub_length_mm: float = 12.0,
    rim_mm: float = 1.5,
    tooth: int | None = None,
) -> Part:
    """Straight bevel gear, axis z, large end and hub below, centred between its ends.

    All tooth lines meet in the pitch cone's apex. At the large end the teeth have the involute
    outline of a spur gear of the same pitch circle, laid onto the back cone with the addendum and
    dedendum (1 and 1.25 modules) along it; so flanks are involutes seen along the axis, and not
    those of Tredgold's virtual gear.

    Parameters
    ----------
    teeth
    module_mm
        Pitch diameter at the large end over the number of teeth.
    pitch_angle_deg
        Half the opening angle of the pitch cone, degrees; 45 for two equal gears.
    pressure_angle_deg
        Of the involutes, degrees.
    face_width_mm
        Length of the teeth along the pitch cone; by default a third of the way to the apex.
    bore_diameter_mm
        Diameter of the bore.
    hub_diameter_mm
        Diameter of the hub.
    hub_length_mm
        From the plane of the large end's pitch circle to the hub's end.
    rim_mm
        Thickness of the rim below the teeth, along the axis and across it.
    tooth
        Number of a tooth, counter-clockwise from +x (0), that gets a region of its own, "tooth".

    Returns
    -------
    Part
        Regions `REGIONS`, and `TOOTH` first if it is requested. Front and back are the ends
        with the teeth's end faces.

    Raises
    ------
    InputError
        The sizes make no gear.
    """
    check_count("bevel gear", "teeth", teeth, 8, 400)
    check_positive(
        "bevel gear",
        module=module_mm,
        bore_diameter=bore_diameter_mm,
        hub_diameter=hub_diameter_mm,
        hub_length=hub_length_mm,
        rim=rim_mm,
    )
    outline = _outline(teeth, module_mm, pitch_angle_deg, pressure_angle_deg)
    if tooth is not None and not 0 <= tooth < teeth:
        raise InputError(
            f"There is no tooth {tooth} on a bevel gear with {teeth} teeth; give 0 to {teeth - 1}.",
            code="scenes.unknown_tooth",
        )
    cone = np.radians(pitch_angle_deg)
    reach = outline.pitch_radius / float(np.sin(cone))
    width = reach / 3.0 if face_width_mm is None else face_width_mm
    check_positive("bevel gear", face_width=width)
    sizes = ("face width", width), ("cone distance", reach)
    check_less("bevel gear", *sizes, "its teeth end before the apex")
    if not outline.half_angle(outline.tip_radius) > 0.0:
        raise InputError(
            f"Teeth of {pressure_angle_deg:g} degrees pressure angle come to a point below the tip "
            f"of a bevel gear with {teeth} teeth; give more teeth or a smaller angle.",
            code="scenes.size",
        )
    rings = _rings(
        outline,
        slope=float(np.tan(cone)),
        small_end=1.0 - width / reach,
        bore=0.5 * bore_diameter_mm,
        hub=0.5 * hub_diameter_mm,
        hub_end=-hub_length_mm,
        rim=rim_mm,
    )
    # The last ring is joined to the first: the same points twice, of which one set is used.
    vertices, faces = between_rings([*rings, rings[0]])
    vertices = vertices[: -len(rings[0])]
    faces %= len(vertices)
    vertices[:, 2] -= 0.5 * (vertices[:, 2].max() + vertices[:, 2].min())
    # The rings run up the bore and down the teeth, about the axis from below.
    return part_of_mesh(vertices, faces[:, ::-1], name="bevel gear", regions=_regions(teeth, tooth))


def _outline(
    teeth: int, module: float, pitch_angle_deg: float, pressure_angle_deg: float
) -> Involute:
    """Teeth at the large end, whose heights along the back cone are shortened across the axis."""
    _check_angle("pitch angle", pitch_angle_deg, 10.0, 80.0)
    _check_angle("pressure angle", pressure_angle_deg, 14.0, 30.0)
    pitch_radius = 0.5 * teeth * module
    shortened = float(np.cos(np.radians(pitch_angle_deg)))
    return Involute(
        teeth,
        pitch_radius,
        root_radius=pitch_radius - _DEDENDUM * module * shortened,
        tip_radius=pitch_radius + _ADDENDUM * module * shortened,
        pressure_angle=float(np.radians(pressure_angle_deg)),
    )


def _check_angle(name: str, degrees: float, low: float, high: float) -> None:
    if not low <= degrees <= high:
        raise InputError(
            f"A {name} of {degrees:g} degrees makes no usable gear; give {low:g} to {high:g}.",
            code="scenes.size",
        )


def _rings(
    outline: Involute,
    *,
    slope: float,
    small_end: float,
    bore: float,
    hub: float,
    hub_end: float,
    rim: float,
) -> list[FloatArray]:
    """Closed curves along the gear's section: bore, front, teeth, back, hub and its end.

    The pitch circle of the large end lies in z = 0.
    """
    radius, angle = outline.points.T
    back_cone = circle(1.0, 0.0, angle) * radius[:, None]
    back_cone[:, 2] = (radius - outline.pitch_radius) * slope
    apex = np.array((0.0, 0.0, outline.pitch_radius / slope))
    even = angle[0] + 2.0 * np.pi * np.arange(len(angle)) / len(angle)

    def tooth_ring(share: float) -> FloatArray:
        return np.asarray(apex + share * (back_cone - apex))

    def plain_ring(size: float, height: float, evenness: float) -> FloatArray:
        # Away from the teeth the points spread evenly, which makes better triangles.
        return circle(size, height, (1.0 - evenness) * angle + evenness * even)

    front = float(tooth_ring(small_end)[:, 2].min())
    back = float(back_cone[:, 2].min()) - rim
    small_root, rim_radius = outline.root_radius * small_end, outline.root_radius - rim
    # Curves of the section must not cross.
    bore_size, hub_size = ("bore diameter", 2.0 * bore), ("hub diameter", 2.0 * hub)
    for smaller, larger, why in (
        (bore_size, hub_size, "a wall has to be left between them"),
        (
            bore_size,
            ("root diameter of the small end", 2.0 * small_root),
            "the bore would cut the teeth",
        ),
        (hub_size, ("rim's diameter", 2.0 * rim_radius), "the hub stands on the rim's back"),
        (("depth of the rim", -back), ("hub length", -hub_end), "the hub ends behind the rim"),
    ):
        check_less("bevel gear", smaller, larger, why)
    rings = [plain_ring(bore, z, 1.0) for z in np.linspace(hub_end, front, _BORE_ROWS + 1)]
    for k in range(1, _FACE_ROWS):
        size = bore + (small_root - bore) * k / _FACE_ROWS
        rings.append(plain_ring(size, front, 1.0 - 0.33 * k))
    rings += [tooth_ring(share) for share in np.linspace(small_end, 1.0, _TOOTH_ROWS + 1)]
    rings += [plain_ring(rim_radius, back, 0.3), plain_ring(hub, back, 0.8)]
    rings += [plain_ring(hub, z, 1.0) for z in np.linspace(back, hub_end, _HUB_ROWS + 1)[1:]]
    ends = np.linspace(hub, bore, _FACE_ROWS + 1)[1:-1]
    return rings + [plain_ring(size, hub_end, 1.0) for size in ends]


def _regions(teeth: int, tooth: int | None) -> Regions:
    """Regions of the faces, in the order of the strips between `_rings`."""
    strips = ("bore", "front", "teeth", "back", "hub", "back")
    rows = (_BORE_ROWS, _FACE_ROWS, _TOOTH_ROWS, 2, _HUB_ROWS, _FACE_ROWS)
    per_row = 2 * teeth * PER_TOOTH
    number = np.repeat([REGIONS.index(strip) for strip in strips], np.multiply(rows, per_row))
    if tooth is None:
        return Regions(number, REGIONS)
    row, place = np.divmod(np.arange(len(number)), per_row)
    # From the middle of the gap before the tooth to the middle of the gap after it.
    before = (place // 2 + ROOT_STEPS // 2) // PER_TOOTH % teeth
    flank = 2 * FLANK_POINTS + TIP_STEPS - 2
    on_end_face = (row == _BORE_ROWS + _FACE_ROWS - 1) & ((place // 2) % PER_TOOTH < flank - 1)
    own = (before == tooth) & ((number == REGIONS.index("teeth")) | on_end_face)
    return Regions(np.where(own, 0, number + 1), (TOOTH, *REGIONS))
