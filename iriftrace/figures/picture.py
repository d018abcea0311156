"""Description of a picture in space: the window, the image, the page and notebooks draw from it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np
import pyvista as pv
from attrs import Factory, evolve, frozen
from vtkmodules.vtkFiltersCore import vtkBinnedDecimation

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.mesh.triangles import polydata
from iriftrace.figures.style import ColourScale
from iriftrace.part.part import Part

PART_COLOUR = "#ff8c1a"
BLOCKER_COLOUR = "#9aa0a6"
SIGHT_COLOUR = "#0f6b8f"
SECOND_COLOUR = "#a8541b"
RAY_COLOUR = "#b3125f"
UNKNOWN_COLOUR = "#c9c9c9"

# A body is drawn as large as this fraction of the part's diagonal; a bent ray bows by the other.
_DEVICE_SIZE = 0.09
_BOW = 0.1
_MOST_TIMES = 1e8
"""Largest exaggeration to begin with: what it does not show is rounding."""

# For one surface. The time of the reduction grows with the third power of the bins along each side;
# these are about as fine as the picture's pixels and cost 0.07 s.
_MOST_TRIANGLES = 100_000
_BINS = 400


@frozen(eq=False)
class DrawnBody:
    """A body, a shell of air or a cloud of points, in one colour or in those of numbers.

    Attributes
    ----------
    name : str
        For the legend.
    vertices : (n, 3) array, mm, world
    faces : (m, 3) array of int
        Empty for points.
    colour : str
        Of the whole, and of what has no number.
    scale : ColourScale or None
        Colours of the values.
    values : (n,) array, (m,) array, float or None
        Numbers of the vertices, of the faces or of the whole; NaN where nothing is known.
    u : array or None
        Standard uncertainty of each value, in the same unit.
    members : dict of (n,) arrays
        Values by each member of an ensemble.
    moved : (n, 3) array or None, mm
        Displacements, which a page can exaggerate.
    normals : (n, 3) array or None
        For shading.
    opacity : float
    member : int or None
        Number of the only member to which it belongs, from 0.
    every : int
        Of so many points of a cloud it has the first.
    size : float
        Of a point on a page, in distances to its neighbours.
    """

    name: str
    vertices: FloatArray
    faces: IntArray
    colour: str = PART_COLOUR
    scale: ColourScale | None = None
    values: FloatArray | float | None = None
    u: FloatArray | None = None
    members: Mapping[str, FloatArray] = Factory(dict)
    moved: FloatArray | None = None
    normals: FloatArray | None = None
    opacity: float = 1.0
    member: int | None = None
    every: int = 1
    size: float = 1.35

    def thinned(self, every: int) -> DrawnBody:
        """A cloud of the first of every so many points, in the colours of all."""
        if every == 1:
            return self
        rows = slice(None, None, every)
        given = {name: getattr(self, name) for name in ("values", "u", "moved")}
        less = {name: each[rows] for name, each in given.items() if each is not None}
        members = {name: each[rows] for name, each in self.members.items()}
        return evolve(self, vertices=self.vertices[rows], members=members, every=every, **less)

    @property
    def of_points(self) -> bool:
        """True for a cloud."""
        return not len(self.faces)

    @property
    def is_shell(self) -> bool:
        """True for a surface of equal temperature, which is seen through and may be cut open."""
        return isinstance(self.values, float)

    @property
    def number_of(self) -> str:
        """``"vertex"`` or ``"face"`` of which the values are."""
        assert self.values is not None
        return "vertex" if len(np.atleast_1d(self.values)) == len(self.vertices) else "face"

    @cached_property
    def mesh(self) -> pv.PolyData:
        """The surface or, if it is huge, one with vertices merged that lie in one bin."""
        mesh = polydata(self.vertices, self.faces)
        if self.normals is not None:
            mesh.point_data.active_normals = self.normals.astype(np.float64)
        if mesh.n_cells <= _MOST_TRIANGLES:
            return mesh
        thinning = vtkBinnedDecimation()
        thinning.SetInputData(mesh)
        thinning.AutoAdjustNumberOfDivisionsOff()
        size = np.ptp(np.asarray(mesh.bounds).reshape(3, 2), axis=1)
        divisions = np.maximum(1, np.ceil(_BINS * size / size.max())).astype(int)
        thinning.SetNumberOfDivisions(*divisions.tolist())
        thinning.SetProducePointData(True)
        thinning.Update()
        return pv.wrap(thinning.GetOutput())

    @cached_property
    def spacing(self) -> float:
        """Distance of points of a cloud to their fourth neighbour, mm: the 75th percentile."""
        from scipy.spatial import KDTree

        if len(self.vertices) < 5:
            return 1.0
        sample = self.vertices[:: 1 + len(self.vertices) // 5000]
        distance, _ = KDTree(self.vertices).query(sample, k=5)
        return float(np.percentile(distance[:, 4], 75)) or 1.0


@frozen(eq=False)
class Lines:
    """Lines in one colour: paths of (k, 3) points, mm, world.

    Of bent rays `straight` has the straight ones, point for point: the difference is drawn
    `exaggerated` times as large.
    """

    name: str
    paths: Sequence[FloatArray]
    colour: str
    straight: Sequence[FloatArray] = ()
    exaggerated: float = 1.0
    width: float = 3.0  # px

    @property
    def drawn(self) -> Sequence[FloatArray]:
        """The paths with their bending exaggerated."""
        if not self.straight:
            return self.paths
        pairs = zip(self.paths, self.straight, strict=True)
        return [line + self.exaggerated * (path - line) for path, line in pairs]


@frozen(eq=False)
class Device:
    """A camera, a projector or a laser in space, as large as can be seen next to the part.

    `focus` states whether the ends of its focus interval are drawn.
    """

    name: str
    camera: Camera
    part: Part
    colour: str = SIGHT_COLOUR
    focus: bool = True

    @cached_property
    def body(self) -> pv.PolyData:
        """A box and a lens behind the pinhole; mm, world."""
        axis = (0.0, 0.0, 1.0)
        box = pv.Cube(center=(0.0, 0.0, -0.75), x_length=1.3, y_length=0.95, z_length=0.9)
        lens = pv.Cylinder(
            center=(0.0, 0.0, -0.15), direction=axis, radius=0.36, height=0.3, resolution=48
        )
        body: pv.PolyData = box.triangulate().append_polydata(lens.triangulate())
        body.points *= _DEVICE_SIZE * float(np.linalg.norm(np.ptp(self.part.bounds, axis=0)))
        return body.transform(self.camera.matrix, inplace=True)

    @cached_property
    def sight(self) -> list[tuple[str, FloatArray]]:
        """Edges of its view, without names, and outlines of its focus interval; mm, world.

        If the far focus lies well behind the part, the edges end earlier and it has no outline.
        """
        camera = self.camera
        local = camera.to_camera(self.part.vertices)
        pinhole = camera.projection == "pinhole"
        distances = np.linalg.norm(local, axis=1) if pinhole else local[:, 2]
        near, far = camera.focus_mm
        # A far end that lies well behind the part would make the part small in the picture.
        reach = min(far, 1.3 * float(distances.max()))
        corners = camera.corners
        fractions = np.linspace(0.0, 1.0, 17)[:-1, None]
        pairs = zip(corners, np.roll(corners, -1, 0), strict=True)
        border = np.concatenate([*(a + fractions * (b - a) for a, b in pairs), corners[:1]])

        starts, directions = camera.rays(corners)
        ends = starts + reach * directions
        lines = [("", np.stack(pair)) for pair in zip(starts, ends, strict=True)]
        starts, directions = camera.rays(border)
        if not pinhole:
            lines.append(("", starts))
        for name, distance in (("Near focus", near), ("Far focus", far)):
            if self.focus and 0.0 < distance <= reach:
                # The focus interval is measured along the ray: the outline lies on a sphere.
                lines.append((f"{name} {distance:g} mm", starts + distance * directions))
        return lines


@frozen(eq=False)
class Poses:
    """Poses of a sweep, coloured by a number.

    Attributes
    ----------
    matrices : (n, 4, 4) array, mm, world
    targets : (n, 3) array, mm, world
    scale : ColourScale
        Of the (n,) numbers, which are its values.
    headings, rows : tuple of str, tuple of tuples of str
        Table of the poses' numbers.
    best : int
    draw_maps : callable
        Returns `maps`; it may render poses, for which only a page waits.
    """

    matrices: FloatArray
    targets: FloatArray
    scale: ColourScale
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    best: int
    draw_maps: Callable[[], tuple[Mapping[int, bytes], str]] = lambda: ({}, "")

    @cached_property
    def maps(self) -> tuple[Mapping[int, bytes], str]:
        """PNGs of what poses see, and their caption with the unit and limits of their colours."""
        return self.draw_maps()

    @property
    def origins(self) -> FloatArray:
        """(n, 3) array, mm, world: positions of the cameras."""
        return np.asarray(self.matrices[:, :3, 3])

    @cached_property
    def cones(self) -> DrawnBody:
        """Equal cones that point where the cameras look, pose by pose."""
        reach = np.linalg.norm(self.targets - self.origins, axis=1).max()
        length = 0.05 * float(reach)
        points = pv.PolyData(self.origins)
        points["aim"] = self.matrices[:, :3, 2]
        shape = pv.Cone(center=(0.5 * length, 0.0, 0.0), height=length, radius=0.4 * length)
        shape.rotate_y(180.0, point=shape.center, inplace=True)
        shape = shape.triangulate()
        cones = points.glyph(orient="aim", scale=False, geom=shape)
        values = np.repeat(self.scale.values, shape.n_cells)
        faces = cones.regular_faces
        return DrawnBody("poses", as_points(cones), faces, UNKNOWN_COLOUR, self.scale, values)


@frozen(eq=False)
class SpacePicture:
    """A picture in space.

    Attributes
    ----------
    title, subtitle : str
    surfaces, lines, devices : tuples
    poses : Poses or None
    members : tuple of str
        Members of an ensemble of which one at a time is drawn, or the mean.
    towards : (3,) array
        Unit vector to the viewer.
    cut : pair of (3,) arrays or None
        A point, mm, and a unit normal: shells are drawn on the other side of this plane.
    exaggerated : str
        What the page can exaggerate, such as "bending of the rays".
    hidden : tuple of str
        Names of the legend that are not drawn, until a page's reader asks for them.
    facts : tuple of tuples of str
        Names and values of the provenance.
    mark : str
        That the air is a synthetic one, or "".
    """

    title: str
    subtitle: str = ""
    surfaces: tuple[DrawnBody, ...] = ()
    lines: tuple[Lines, ...] = ()
    devices: tuple[Device, ...] = ()
    poses: Poses | None = None
    members: tuple[str, ...] = ()
    towards: FloatArray = Factory(lambda: np.full(3, math.sqrt(1.0 / 3.0)))
    cut: tuple[FloatArray, FloatArray] | None = None
    exaggerated: str = ""
    hidden: tuple[str, ...] = ()
    facts: tuple[tuple[str, ...], ...] = ()
    mark: str = ""

    @property
    def shells(self) -> tuple[DrawnBody, ...]:
        """Surfaces of equal temperature, the outermost first."""
        return tuple(surface for surface in self.surfaces if surface.is_shell)

    @property
    def opacity(self) -> float:
        """Opacity of all shells of one member together."""
        through = [1.0 - shell.opacity for shell in self.shells if not shell.member]
        return 1.0 - math.prod(through)

    @property
    def scales(self) -> tuple[ColourScale, ...]:
        """The colour scales of the numbers, each once."""
        poses = () if self.poses is None else (self.poses.scale,)
        found = [*(each.scale for each in self.surfaces if each.scale is not None), *poses]
        return tuple({id(scale): scale for scale in found}.values())

    @property
    def legend(self) -> dict[str, str]:
        """Colours of what has one colour, by name."""
        named = {s.name: s.colour for s in self.surfaces if not s.is_shell and s.values is None}
        named |= {line.name: line.colour for line in self.lines if line.name}
        return named | {device.name: device.colour for device in self.devices}

    @property
    def note(self) -> str:
        """What an image must state about exaggeration and the colours of shells."""
        found = [f"{self.exaggerated} drawn {self.factor:g} times as large"] if self.factor else []
        for scale in {id(shell.scale): shell.scale for shell in self.shells}.values():
            assert scale is not None
            low, high = (f"{end:.0f} °C" for end in scale.limits)
            found.append(f"Shells from {low} (blue) to {high} (yellow)")
        return "\n".join(found)

    @property
    def factor(self) -> float:
        """The exaggeration with which the page begins: 0 for points, so at their true places."""
        return max((line.exaggerated for line in self.lines if line.straight), default=0.0)

    @property
    def factors(self) -> tuple[float, ...]:
        """Exaggerations to choose from."""
        most = 5.0 * self.factor
        for surface in self.surfaces:
            if surface.moved is not None:
                size = float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
                largest = float(np.percentile(np.linalg.norm(surface.moved, axis=1), 99))
                most = 2.0 * round_factor(largest, size)
        steps = (step * 10.0**power for power in range(9) for step in (1.0, 2.0, 5.0))
        return 0.0, *(step for step in steps if step <= most)

    @property
    def text(self) -> str:
        """The picture in words, for those who do not see it."""
        shown = [*self.legend, *(scale.label for scale in self.scales)]
        return ". ".join(filter(None, (self.title, self.subtitle, f"Shown: {', '.join(shown)}")))


def part_surface(part: Part, name: str = "part", colour: str = PART_COLOUR) -> DrawnBody:
    """A part, or another body, in one colour."""
    return DrawnBody(name, part.vertices, part.faces, colour)


def as_points(mesh: pv.PolyData) -> FloatArray:
    """(n, 3) array of a mesh's points."""
    return np.asarray(mesh.points, dtype=np.float64)


def round_factor(largest: float, size: float) -> float:
    """A round factor (1, 2, 5, 10 ...) that makes the largest bow visible next to a size."""
    if not largest > 0.0:
        return 1.0
    factor = min(max(1.0, _BOW * size / largest), _MOST_TIMES)
    power = 10.0 ** math.floor(math.log10(factor))
    return power * max(step for step in (1.0, 2.0, 5.0) if step * power <= factor * (1 + 1e-9))
