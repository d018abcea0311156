"""The measured part: a triangle surface in millimetres with named regions."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from attrs import evolve, frozen
from numpy.typing import ArrayLike

from iriftrace.core.arrays import FloatArray, IntArray, as_float64
from iriftrace.core.errors import InputError, warn
from iriftrace.core.mesh.query import Places, Surface
from iriftrace.core.mesh.topology import connected, weld
from iriftrace.core.mesh.transform import apply, checked_matrix
from iriftrace.core.mesh.triangles import unit_vectors
from iriftrace.part.growth import Growth
from iriftrace.part.regions import (
    SMALLEST_SHARE,
    Regions,
    find_smooth_groups,
    name_regions,
)
from iriftrace.part.soundness import (
    PLAUSIBLE_SIZE_MM,
    distinct_faces,
    is_unlikely_size,
    oriented_outward,
    signed_volume,
    warn_of_folds,
    warn_of_rounding,
)

FARTHEST_MM = 1e9
"""Larger coordinates mean damage: a thousand kilometres, whose cube still fits in float32."""

MOST_FACES = 2**24 - 2
"""The EXR channel ``part.face`` is float32, which holds face number + 1 exactly up to here."""

FEWEST_PLACES = 2**15
"""Number of points on a part at which the seen fraction of a flat face is right to 1e-3."""


@frozen(eq=False)
class Part:
    """Triangle surface of the measured part.

    Attributes
    ----------
    vertices
        (n, 3) array, mm, world.
    faces
        (m, 3) vertex numbers, counter-clockwise seen from outside, in the order of the file,
        without triangles that lie on others.
    region_of_face
        (m,) number of each face's region, an index into `region_names`.
    region_names
        Names of the regions.
    smooth_group
        (m,) number of the smoothly connected patch that each face belongs to.
    path, sha256
        The file and the SHA-256 of its bytes.
    length_unit
        The unit in which the file was read.
    closed
        Whether every edge belongs to an even number of triangles.
    growth
        Thermal expansion contained in the vertices, if known.
    drawing
        (n, 3) array, mm, world: the vertices of the cold part, if it has grown unevenly or not
        about the world's origin.
    """

    vertices: FloatArray
    faces: IntArray
    region_of_face: IntArray
    region_names: tuple[str, ...]
    smooth_group: IntArray
    path: str
    sha256: str
    length_unit: str
    closed: bool
    growth: Growth | None = None
    drawing: FloatArray | None = None

    def __repr__(self) -> str:
        extent = " x ".join(f"{length:.5g}" for length in np.ptp(self.bounds, axis=0))
        kind = "closed" if self.closed else "open"
        return (
            f"Part({self.path}: {extent} mm, {len(self.faces):,} triangles, {kind}, "
            f"{len(self.region_names)} regions)"
        )

    @cached_property
    def surface(self) -> Surface:
        """The surface, for queries of nearest points and gaps."""
        return Surface(self.vertices, self.faces)

    @property
    def closed_surface(self) -> Surface:
        """The surface of a closed part, which has an inside; an InputError if it is not closed."""
        if not self.closed:
            raise InputError(
                f"{self.path} is not closed, so it is not clear where the air is; repair the mesh "
                "(fill its holes) first.",
                code="part.not_closed",
            )
        return self.surface

    @property
    def face_areas(self) -> FloatArray:
        """(m,) array, mm^2."""
        return self.surface.areas

    @property
    def face_normals(self) -> FloatArray:
        """(m, 3) unit vectors, outward for a closed part; zero for a face without area."""
        return self.surface.normals

    @cached_property
    def face_centres(self) -> FloatArray:
        """(m, 3) array, mm, world."""
        return as_float64(self.vertices[self.faces].mean(axis=1))

    @cached_property
    def face_offsets(self) -> FloatArray:
        """(m,) array, mm: distance of each face's plane from the origin, along its normal."""
        return as_float64(np.einsum("ij,ij->i", self.face_normals, self.face_centres))

    @cached_property
    def places(self) -> Places:
        """Points on all faces, by which seen areas are measured."""
        return self.surface.places_on_faces(FEWEST_PLACES)

    @cached_property
    def region_areas(self) -> FloatArray:
        """(r,) array, mm^2: area of each region."""
        count = len(self.region_names)
        areas = np.bincount(self.region_of_face, self.face_areas, minlength=count)
        return areas.astype(np.float64)

    @cached_property
    def area(self) -> float:
        """Area of the whole surface, mm^2."""
        return float(self.face_areas.sum())

    @cached_property
    def volume(self) -> float:
        """Volume inside a closed part, mm^3: the sum of the tetrahedra from its middle."""
        return abs(signed_volume(self.vertices - self.centre, self.faces))

    @cached_property
    def bounds(self) -> FloatArray:
        """(2, 3) array, mm, world: lowest and highest coordinates."""
        used = self.vertices[self.faces.ravel()]
        return np.stack((used.min(axis=0), used.max(axis=0)))

    @property
    def centre(self) -> FloatArray:
        """(3,) array, mm, world: middle of `bounds`."""
        return as_float64(self.bounds.mean(axis=0))

    def transformed(self, matrix: ArrayLike) -> Part:
        """The part transformed; a mirrored one keeps its outward orientation.

        Parameters
        ----------
        matrix
            (4, 4) array, old to new coordinates, mm.

        Raises
        ------
        InputError
            The matrix is not an invertible affine one.
        """
        affine = checked_matrix(matrix)
        mirrored = np.linalg.det(affine[:3, :3]) < 0
        drawing = self.drawing
        if drawing is None and self.growth is not None and affine[:3, 3].any():
            # The origin, about which it has grown, moves too.
            drawing = self.vertices / self.growth.factor
        return evolve(
            self,
            vertices=apply(affine, self.vertices),
            drawing=None if drawing is None else apply(affine, drawing),
            faces=self.faces[:, ::-1] if mirrored else self.faces,
        )


def part_of_mesh(
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    name: str,
    sha256: str = "",
    length_unit: str = "mm",
    regions: Regions | None = None,
    surfaces: IntArray | None = None,
    transform: ArrayLike | None = None,
    region_angle_deg: float = 30.0,
) -> Part:
    """Check a triangle mesh and find its regions.

    Parameters
    ----------
    vertices
        (n, 3) array, mm.
    faces
        (m, 3) vertex numbers.
    name
        Origin of the mesh, for messages and provenance.
    sha256, length_unit
        Those of its file, if there is one.
    regions
        Named regions, if known.
    surfaces
        (m,) number of the CAD surface on which each face lies, if known; adjoining faces on one are
        a region.
    transform, region_angle_deg
        As for `read_part`; errors and warnings are the same, too.
    """
    if not 0 < region_angle_deg < 180:
        raise InputError(
            f"a region angle of {region_angle_deg} degrees separates nothing; "
            "give one between 0 and 180.",
            code="part.region_angle",
            argument="region_angle",
        )
    points = np.asarray(vertices, dtype=np.float64)
    triangles = np.asarray(faces, dtype=np.int64)
    _refuse_unusable(name, points, triangles)
    welded = weld(points)
    distinct = distinct_faces(welded[triangles])
    if not distinct.all():
        warn(
            f"{name} has {np.count_nonzero(~distinct)} triangles that lie exactly on others (a "
            "body that was exported twice, both sides of a surface, or the wall between two bodies "
            "that touch); they are left out."
        )
        triangles = triangles[distinct]
        regions = regions and evolve(regions, of_face=regions.of_face[distinct])
        surfaces = None if surfaces is None else surfaces[distinct]
    triangles, neighbours = oriented_outward(name, points, triangles, welded)
    surface = Surface(points, triangles)
    if surface.areas.sum() <= 0:
        raise InputError(
            f"{name} has triangles but no area; export the part's surface again.",
            code="part.no_area",
        )
    warn_of_folds(name, neighbours, surface.normals, surface.areas)
    groups = find_smooth_groups(neighbours, surface.normals, region_angle_deg)
    if surfaces is None:
        named = regions or _named_regions(groups, surface, transform)
    else:
        first, second = neighbours.pairs.T
        same = neighbours.pairs[surfaces[first] == surfaces[second]]
        patches = connected(same, len(triangles))
        named = _named_regions(patches, surface, transform, smallest=0.0)
    part = Part(
        vertices=points,
        faces=triangles,
        region_of_face=named.of_face,
        region_names=named.names,
        smooth_group=groups,
        path=name,
        sha256=sha256,
        length_unit=length_unit,
        closed=not neighbours.open_edges,
    )
    part = part if transform is None else part.transformed(transform)
    warn_of_rounding(name, float(np.abs(part.bounds).max()))
    return part


def _named_regions(
    groups: IntArray,
    surface: Surface,
    transform: ArrayLike | None,
    smallest: float = SMALLEST_SHARE,
) -> Regions:
    """Regions with names by directions in the world's frame, in which the user sees the part."""
    normals, vertices = surface.normals, surface.vertices
    if transform is not None:
        matrix = checked_matrix(transform)
        # Normals transform with the inverse transpose, for either sign of the determinant.
        normals = unit_vectors(normals @ np.linalg.inv(matrix[:3, :3]))
        vertices = apply(matrix, vertices)
    return name_regions(groups, normals, surface.areas, vertices, surface.faces, smallest)


def _refuse_unusable(name: str, points: FloatArray, triangles: IntArray) -> None:
    if len(triangles) > MOST_FACES:
        raise InputError(
            f"{name} has {len(triangles)} triangles, but at most {MOST_FACES} can be numbered "
            "in the EXR; simplify the mesh.",
            code="part.too_many_triangles",
        )
    if not np.isfinite(points).all():
        raise InputError(
            f"{name} has vertices that are NaN or infinite; export the part again.",
            code="part.not_finite",
        )
    if np.abs(points).max(initial=0.0) > FARTHEST_MM:
        raise InputError(
            f"{name} has a vertex {np.abs(points).max():.3g} mm from the origin, farther than any "
            f"part ({FARTHEST_MM:g} mm); export the part again.",
            code="part.too_far",
        )


def refuse_unlikely_size(part: Part) -> None:
    """Refuse to generate air around a part that was read in the wrong unit.

    With an existing field the sizes are compared (`iriftrace.medium.part_fit`); air generated for
    the part would have the wrong size too, so the mistake would not be detected.
    """
    size = float(np.linalg.norm(np.ptp(part.bounds, axis=0)))
    if is_unlikely_size(size):
        smallest, largest = PLAUSIBLE_SIZE_MM
        raise InputError(
            f"{part.path} is {size:.3g} mm across when read as {part.length_unit}, and air is made "
            f"for parts of {smallest:g} mm to {largest / 1000:g} m; give the file's unit as "
            "length_unit.",
            code="part.unlikely_size",
            argument="length_unit",
        )
