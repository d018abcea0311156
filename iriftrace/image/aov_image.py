"""The AOV image of one pose: its channels, and the status of each ray."""

from __future__ import annotations

from enum import IntEnum
from functools import cached_property

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.files import FileOrigin
from iriftrace.core.plain import JsonObject

FloatImage = NDArray[np.float32]

CHANNELS: tuple[str, ...] = (
    *(f"{name}.{axis}" for name in ("straight", "refracted", "displacement") for axis in "XYZ"),
    "displacement.norm",
    "shift.px.X",
    "shift.px.Y",
    "incidence.angle",
    "path.length",
    "path.crossings",
    "part.face",
    "status.code",
)
"""Millimetres and radians in the world's frame; ``shift.px`` in pixels."""

ERROR_CHANNEL = "path.error"
"""Estimated error of the refracted hit, mm; only the cells engine delivers it."""

U_CHANNEL = "displacement.u.norm"
"""Standard uncertainty of the displacement, mm: root of the sum of its variances along the axes."""

MEMBERS_CHANNEL = "ensemble.members"
"""Number of members of an ensemble in which the pixel's ray counts."""

WORST_CHANNEL = "ensemble.worst"
"""Number of the member that displaces the pixel most; 0 where the ray counts in none."""

WORST_NORM_CHANNEL = "displacement.worst.norm"
"""Length of that member's displacement, mm."""

SCATTER_CHANNELS: tuple[str, ...] = (
    *(f"displacement.std.{axis}" for axis in "XYZ"),
    "displacement.std.norm",
    "shift.px.std.X",
    "shift.px.std.Y",
    MEMBERS_CHANNEL,
    WORST_CHANNEL,
    WORST_NORM_CHANNEL,
)
"""Standard deviations over an ensemble's members, mm and pixels, and its worst member."""

LIGHT_CHANNELS = tuple(f"second{air}.px.{axis}" for air in ("", ".cold") for axis in "XY")
"""Place in the second device's picture, px, from where the refracted hit is lit (``second.cold``:
the straight hit without hot air); -1 where it is not. Photographs have them."""

SCHEMA = "iriftrace.aov/1"
"""Value of the header entry ``schema`` of the files that this version writes and reads."""


NEEDED = ("part", "camera", "pose", "counts", "assumptions", "time_s")
KNOWN = (*CHANNELS, ERROR_CHANNEL, U_CHANNEL, *SCATTER_CHANNELS, *LIGHT_CHANNELS)


class Status(IntEnum):
    """Outcome of one ray.

    If several codes apply to a ray, it gets the first of 1, 2, 7, 6, 3, 4, 5, 0. A ray with an
    impossible deflection gets 5, even if it misses the part, and before 3 and 4.
    """

    text: str
    """The outcome in words, for tables and legends."""

    GOOD = 0, "good"
    """Straight and refracted ray hit the part, and the index steps add up."""
    MISSED = 1, "missed the part"
    """Both rays missed the part, or the straight one did and only rays that hit are traced on."""
    OUT_OF_FOCUS = 2, "out of focus"
    """The straight ray's length from camera to hit lies outside the focus interval."""
    REFRACTED_MISSED = 3, "only the straight ray hit"
    """The straight ray hit the part, but the refracted one missed it."""
    ONLY_REFRACTED = 4, "only the refracted ray hit"
    """The refracted ray hit the part, but the straight one missed it."""
    INDEX_MISMATCH = 5, "inconsistent deflection"
    """Both hit, but the index steps do not add up to the layer at the hit; or the refracted ray is
    deflected by more than the index range along it can give."""
    GAVE_UP = 6, "lost on the way"
    """The refracted ray could not be followed to its end: it was lost, or reached the limit of
    crossings or steps."""
    BLOCKED = 7, "another object in the way"
    """Another opaque object is in the way of either ray, and the straight one would hit the part.

    Bundles of rays, and pictures that Mitsuba renders alone, have it wherever an object is met.
    """

    def __new__(cls, code: int, text: str) -> Status:
        status = int.__new__(cls, code)
        status._value_, status.text = code, text
        return status

    @property
    def key(self) -> str:
        """Name of the code in the metrics JSON, such as ``out_of_focus``."""
        return self.name.lower()

    @property
    def lost(self) -> bool:
        """True if the ray's end is not known for a reason other than the view."""
        return self in (Status.INDEX_MISMATCH, Status.GAVE_UP)


@frozen(eq=False)
class AovImage:
    """Per-pixel results of one pose, and their origin.

    Row i and column j of a channel belong to the ray through the pixel's centre (j, i).

    Attributes
    ----------
    channels
        (height, width) float32 arrays by the names in `CHANNELS`, and perhaps `ERROR_CHANNEL` and
        `SCATTER_CHANNELS`; mm and rad, world frame; 0 where a quantity does not exist.
    header
        Plain JSON values: schema, version, camera, pose, engine, part and the like.
    origin
        The file that it was read from.

    Raises
    ------
    InputError
        A channel is missing, unknown, not float32 or of another size.
    """

    channels: dict[str, FloatImage]
    header: JsonObject = field(factory=dict)
    origin: FileOrigin | None = None

    def __attrs_post_init__(self) -> None:
        of_ensemble = not set(self.channels).isdisjoint(SCATTER_CHANNELS)
        needed = (*CHANNELS, *SCATTER_CHANNELS) if of_ensemble else CHANNELS
        missing = [name for name in needed if name not in self.channels]
        surplus = [name for name in self.channels if name not in KNOWN]
        if missing or surplus:
            raise InputError(
                f"an AOV image has {len(needed)} channels; missing: "
                f"{', '.join(missing) or 'none'}, unknown: {', '.join(surplus) or 'none'}.",
                code="picture.channels",
            )
        shape = self.channels[CHANNELS[0]].shape
        for name, pixels in self.channels.items():
            if pixels.dtype != np.float32 or pixels.ndim != 2 or pixels.shape != shape:
                raise InputError(
                    f"channel {name} is {pixels.dtype} {pixels.shape}, but every channel must be "
                    f"float32 and (height, width) = {shape}; half precision would lose the result.",
                    code="picture.channel_type",
                )
        if 0 in shape:
            raise InputError(
                f"an AOV image of {shape} pixels is empty; render at least one pixel.",
                code="picture.empty",
            )

    def __repr__(self) -> str:
        width, height = self.resolution
        return f"AovImage({width} x {height} px, {len(self.channels)} channels)"

    @property
    def resolution(self) -> tuple[int, int]:
        """Width and height in pixels."""
        height, width = self.channels[CHANNELS[0]].shape
        return int(width), int(height)

    @property
    def status(self) -> IntArray:
        """(height, width) array of the codes of `Status`."""
        return np.rint(self.channels["status.code"]).astype(np.int64)

    @property
    def is_ensemble(self) -> bool:
        """True for the mean and the scatter of several fields."""
        return MEMBERS_CHANNEL in self.channels

    @cached_property
    def camera(self) -> Camera:
        """Camera with which the picture was taken, in its pose; raises InputError if not named."""
        self.require("camera")
        return Camera.from_dict(self.header["camera"])

    def require(self, *keys: str) -> None:
        """Raise InputError if an entry of the image's header is missing."""
        missing = [key for key in keys if key not in self.header]
        if missing:
            raise InputError(
                f"The image's header has no {', '.join(missing)}: a film of Mitsuba wrote it, or "
                "another program removed its entries, which are needed here; render the scene "
                "again with iriftrace.",
                code="picture.no_header",
            )

    def vector(self, name: str, where: BoolArray | None = None) -> FloatArray:
        """Components of one quantity as columns of an array.

        Parameters
        ----------
        name
            ``straight``, ``refracted``, ``displacement`` (mm, world) or ``shift.px`` (pixels); for
            an ensemble also ``displacement.std`` and ``shift.px.std``.
        where
            (height, width) mask of the n pixels to return; all by default.

        Returns
        -------
        (height, width, 3) array, or (n, 3) with a mask; two components for ``shift.px``.

        Raises
        ------
        InputError
            There is no vector of this name.
        """
        keys = [key for key in (f"{name}.{c}" for c in "XYZ") if key in self.channels]
        planes = [self.channels[key] for key in keys]
        if not planes:
            known = sorted({channel[:-2] for channel in self.channels if channel.endswith(".X")})
            raise InputError(
                f"an AOV image has no vector {name!r}; it has {', '.join(known)}.",
                code="picture.no_vector",
            )
        if where is not None:
            selected = np.flatnonzero(where)
            planes = [plane.ravel()[selected] for plane in planes]
        vectors = np.empty((*planes[0].shape, len(planes)))
        for i, plane in enumerate(planes):
            vectors[..., i] = plane
        return vectors
