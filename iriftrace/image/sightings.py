"""Faces of the part that each pose of a sweep sees, and how well: reduced, added up, read again.

In a sweep's file these are contiguous ragged arrays as in the CF conventions (1.11, section 9.3.3):
all rows of the first pose, then all of the second.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import (
    AnyArray,
    Float32Array,
    FloatArray,
    Int32Array,
    IntArray,
    Variables,
)
from iriftrace.core.errors import InputError
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.image.coverage import places_seen, seen_fractions
from iriftrace.image.displacement import directions_to, good_mask
from iriftrace.part.part import Part

if TYPE_CHECKING:
    import xarray as xr


COUNTS = "sightings"
"""Variable with the number of rows of each pose."""

COLUMNS: dict[str, tuple[str, str, str]] = {
    "face": ("i4", "1", "face number, in the order of the part's file"),
    "seen": ("f4", "1", "fraction of the face's area that is seen"),
    "rays": ("i4", "1", "good rays on the face"),
    "displacement": ("f4", "mm", "mean displacement of these rays"),
    "incidence": ("f4", "degree", "smallest angle of incidence of these rays"),
    **{
        f"offset_{axis}": ("f4", "mm", f"mean offset of the line of sight at the part, {axis}")
        for axis in "xyz"
    },
}
"""Columns, with ``sighting_`` before their names in the file: (type, unit, description)."""

ROW = np.dtype([(name, kind) for name, (kind, _, _) in COLUMNS.items()])


@frozen(eq=False)
class FaceSightings:
    """The n faces that one pose sees, or hits with a good ray; (n,) arrays.

    A face between the rays has the means over the rays next to it, NaN if none of them is good, and
    the angle of incidence of its own plane at its centre.
    """

    face: Int32Array  # numbers, ascending
    seen: Float32Array  # fraction of each face's area that is seen, 0..1
    rays: Int32Array  # good rays on each face, 0 if it lies between the rays
    displacement: Float32Array  # mm, mean over these rays
    incidence: Float32Array  # degree, smallest angle of these rays
    # mm, world: vector from the hit of the refracted ray to the straight line of sight,
    # perpendicular to that; mean over these rays.
    offset_x: Float32Array
    offset_y: Float32Array
    offset_z: Float32Array

    @property
    def offset(self) -> FloatArray:
        """(n, 3) array, mm, world."""
        return np.stack((self.offset_x, self.offset_y, self.offset_z), axis=1).astype(np.float64)

    def __len__(self) -> int:
        return len(self.face)

    def as_rows(self) -> AnyArray:
        """(n,) structured array of type `ROW`."""
        rows = np.empty(len(self), dtype=ROW)
        for name in COLUMNS:
            rows[name] = getattr(self, name)
        return rows

    @classmethod
    def from_rows(cls, rows: AnyArray) -> FaceSightings:
        """Inverse of :meth:`as_rows`."""
        return cls(**{name: np.ascontiguousarray(rows[name]) for name in COLUMNS})


NOTHING_SEEN = FaceSightings.from_rows(np.empty(0, dtype=ROW))


def sight_faces(
    image: AovImage, part: Part, include: Collection[int] = (Status.GOOD,)
) -> FaceSightings:
    """Reduce one pose to the faces that it sees; rays count by their status codes (0, 5).

    Raises InputError if `include` names rays without a displacement.
    """
    good = np.flatnonzero(good_mask(image, include))
    own = np.rint(image.channels["part.face"].ravel()[good]).astype(np.int64) - 1
    rays = np.bincount(own, minlength=len(part.faces))
    places = places_seen(image, part, include)
    seen = seen_fractions(part, places)
    # Faces between the rays have those next to them.
    face = part.places.face[places.place]
    beside = (rays[face] == 0) & np.isin(places.pixel, good)
    pixel = np.concatenate((good, places.pixel[beside]))
    number, row = np.unique(
        np.concatenate((own, face[beside], np.flatnonzero(seen))), return_inverse=True
    )
    row = row[: len(pixel)]
    count = np.bincount(row, minlength=len(number))

    def values(name: str) -> AnyArray:
        found: AnyArray = image.channels[name].ravel()[pixel]
        return found

    def mean(column: AnyArray) -> Float32Array:
        with np.errstate(invalid="ignore"):
            return (np.bincount(row, column, minlength=len(number)) / count).astype(np.float32)

    vectors, straight = (
        np.stack([values(f"{name}.{axis}") for axis in "XYZ"], axis=1).astype(np.float64)
        for name in ("displacement", "straight")
    )
    # From the refracted hits to the straight lines of sight, mm.
    sight = directions_to(image.camera, straight)
    offsets = sight * np.einsum("ij,ij->i", vectors, sight)[:, None] - vectors
    return FaceSightings(
        number.astype(np.int32),
        seen[number].astype(np.float32),
        rays[number].astype(np.int32),
        mean(values("displacement.norm")),
        _smallest_angles(image, part, number, own, good),
        *(mean(column) for column in offsets.T),
    )


def _smallest_angles(
    image: AovImage, part: Part, number: IntArray, face: IntArray, pixel: IntArray
) -> Float32Array:
    """Angles of incidence, degree, of faces: the smallest of their rays, else at their centres.

    Rays (n,) of pixels end on faces.
    """
    angle = np.full(len(part.faces), np.inf, dtype=np.float32)
    np.minimum.at(angle, face, image.channels["incidence.angle"].ravel()[pixel])
    found = angle[number].astype(np.float64)
    between = np.flatnonzero(np.isinf(found))
    chosen = number[between]
    sight = directions_to(image.camera, part.face_centres[chosen])
    cosine = np.abs(np.einsum("ij,ij->i", part.face_normals[chosen], sight))
    found[between] = np.arccos(np.minimum(cosine, 1.0))
    return np.degrees(found).astype(np.float32)


def face_maps(sightings: Iterable[FaceSightings], part: Part) -> Variables:
    """Add up the faces of a part that n poses of a sweep see; one pose at a time is in memory.

    Variables for the sweep's dataset: ``sightings`` over ``pose``. Over the m faces: area, region,
    largest fraction seen by one pose, times seen, mean displacement and smallest angle of
    incidence, the latter two NaN for a face that was never seen.
    """
    count = len(part.faces)
    rows_of_pose = []
    most_seen = np.zeros(count, dtype=np.float32)
    times_seen = np.zeros(count, dtype=np.int32)
    weight = np.zeros(count)
    moved = np.zeros(count)
    incidence = np.full(count, np.nan, dtype=np.float32)
    for found in sightings:
        face = found.face
        rows_of_pose.append(len(found))
        times_seen[face] += 1
        most_seen[face] = np.maximum(most_seen[face], found.seen)
        # Poses between whose rays a face lies decide only where no pose hits it.
        known = np.isfinite(found.displacement)
        rays = np.where(found.rays > 0, found.rays, 1e-9)[known]
        weight[face[known]] += rays
        moved[face[known]] += rays * found.displacement[known].astype(np.float64)
        incidence[face] = np.fmin(incidence[face], found.incidence)
    displacement = np.full(count, np.nan, dtype=np.float32)
    seen = weight > 0
    displacement[seen] = moved[seen] / weight[seen]
    region = (part.region_of_face + 1).astype(np.int16)
    of_face: dict[str, tuple[AnyArray, str, str]] = {
        "face_area": (part.face_areas, "mm2", "area"),
        "face_region": (region, "1", "number of the face's region in the coordinate region"),
        "face_seen": (most_seen, "1", "largest fraction of the area that one pose sees"),
        "face_times_seen": (times_seen, "1", "poses that see the face"),
        "face_displacement": (displacement, "mm", "mean displacement of all rays of all poses"),
        "face_incidence": (incidence, "degree", "smallest angle of incidence in any pose"),
    }
    rows = np.array(rows_of_pose, dtype=np.int64)
    text = "faces that the pose sees: rows of the variables over sighting"
    return {
        COUNTS: (
            ("pose",),
            rows,
            {"units": "1", "long_name": text, "sample_dimension": "sighting"},
        ),
        **{
            name: (("face",), values, {"units": unit, "long_name": text})
            for name, (values, unit, text) in of_face.items()
        },
    }


def sightings_of(dataset: xr.Dataset, pose: int) -> FaceSightings:
    """Sightings of one pose of a sweep; only its own rows are read from the file.

    Raises InputError if the sweep has no such pose.
    """
    ends = np.cumsum(dataset[COUNTS].values)
    if not 0 <= pose < len(ends):
        raise InputError(
            f"The sweep has no pose {pose}; its {len(ends)} poses are numbered from 0.",
            code="sweep.no_pose",
        )
    start = int(ends[pose - 1]) if pose else 0
    rows = dataset[[f"sighting_{name}" for name in COLUMNS]].isel(
        sighting=slice(start, int(ends[pose]))
    )
    return FaceSightings(**{name: rows[f"sighting_{name}"].values for name in COLUMNS})


def seen_by_pose(
    dataset: xr.Dataset,
    *,
    max_displacement_mm: float | None = None,
    max_incidence_deg: float | None = None,
) -> Float32Array:
    """Fraction of each face that each pose of a sweep sees well enough: (n, m), 0..1.

    Of n poses and m faces. A face does not count if its mean displacement or smallest angle of
    incidence is larger than a limit. Raises InputError if a limit lets nothing pass, or the sweep
    has no face data.
    """
    if max_displacement_mm is not None and not max_displacement_mm > 0.0:
        raise InputError(
            f"No face has a displacement below {max_displacement_mm:g} mm; give a positive limit.",
            code="sweep.displacement_limit",
            argument="max_displacement",
        )
    if max_incidence_deg is not None and not 0.0 < max_incidence_deg <= 90.0:
        raise InputError(
            f"The largest angle of incidence is {max_incidence_deg:g} degrees, but rays arrive at "
            "0 to 90; give a limit in between.",
            code="sweep.incidence_limit",
            argument="max_incidence",
        )
    poses = dataset.sizes["pose"]
    seen = np.zeros((poses, dataset.sizes["face"]), dtype=np.float32)
    for pose in range(poses):
        found = sightings_of(dataset, pose)
        good = np.ones(len(found.face), dtype=bool)
        if max_displacement_mm is not None:
            good &= found.displacement <= max_displacement_mm  # no unknown one
        if max_incidence_deg is not None:
            good &= found.incidence <= max_incidence_deg
        seen[pose, found.face[good]] = found.seen[good]
    return seen
