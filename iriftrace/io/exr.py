"""OpenEXR files: AOV images, and other pictures.

Sizes and times of 1224 x 1024 x 17 float32 channels, 38 % of the pixels on the part, two cores:
uncompressed 85 MB, 0.09 s; RLE 33 MB, 0.10 s; ZIP 25 MB, 0.32 s; ZIPS 26 MB, 0.31 s; PIZ 20 MB,
0.34 s. ZSTD (14 MB, 0.11 s) is too new for most readers, so RLE is used: every reader
knows it, and it removes the empty background.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from iriftrace.core.arrays import AnyArray
from iriftrace.core.errors import InputError
from iriftrace.core.files import FileOrigin, is_number, sha256_of, whole_file
from iriftrace.core.plain import JsonObject
from iriftrace.image.aov_image import KNOWN, NEEDED, SCHEMA, AovImage, FloatImage
from iriftrace.io.part_files import read_part
from iriftrace.io.reading import ReadPart
from iriftrace.io.refusals import check_exists, check_schema, damaged, not_read
from iriftrace.part.part import Part

RGB = {
    "displacement": ("displacement.X", "displacement.Y", "displacement.Z"),
    "shift": ("shift.px.X", "shift.px.Y"),
    "refracted": ("refracted.X", "refracted.Y", "refracted.Z"),
}
"""Channels that R, G and B may repeat, for programs that show no others; the third of two is 0."""

PREFIX = "iriftrace."

RGB_ENTRY = "rgb"
"""Key of the header that states which channels R, G and B repeat."""

# More threads than this gain nothing for RLE: copying the pixels takes longer than packing them.
THREADS = min(4, os.cpu_count() or 1)


def colour_channels(channels: dict[str, FloatImage], rgb: str) -> dict[str, FloatImage]:
    """Channels R, G and B that repeat others."""
    if rgb not in RGB:
        raise InputError(
            f"R, G and B can repeat {', '.join(RGB)}, but not {rgb!r}; give one.",
            code="picture.rgb",
            argument="rgb",
        )
    planes = [channels[name].copy() for name in RGB[rgb]]
    nothing = [np.zeros_like(planes[0])] * (3 - len(planes))
    return dict(zip("RGB", [*planes, *nothing], strict=True))


def exr_content(name: str, remedy: str) -> tuple[JsonObject, dict[str, AnyArray]]:
    """Header and channels of an OpenEXR file; raises InputError with a remedy if it is damaged.

    A file of which the pixels are only a part of the picture is refused.
    """
    if not OpenEXR.isOpenExrFile(name):
        raise damaged(name, "it is not an OpenEXR file", remedy)
    try:
        with OpenEXR.File(name, separate_channels=True, num_threads=THREADS) as file:
            # Closing the file empties its dictionaries, so both are copied.
            channels = {key: channel.pixels for key, channel in file.channels().items()}
            header = dict(file.header())
    except Exception as error:  # OpenEXR and its layer of Python let any through
        raise damaged(name, error, remedy) from error
    data, whole = (np.asarray(header[f"{of}Window"]).tolist() for of in ("data", "display"))
    if data != whole:
        raise not_read(
            name,
            f"a data window {data} other than its display window {whole}",
            "save the whole picture, without a crop",
        )
    return header, channels


def names_part(named: object) -> bool:
    """True for a header entry with a part's file, checksum, unit and place."""
    return (
        isinstance(named, dict)
        and all(isinstance(named.get(key), str) for key in ("path", "sha256", "length_unit"))
        and isinstance(rows := named.get("to_world"), list)
        and len(rows) == 4
        and all(isinstance(row, list) and len(row) == 4 for row in rows)
        and all(is_number(value) for row in rows for value in row)
    )


def encoded(key: str, value: object) -> str:
    """An entry of the header as text; InputError if it is not plain JSON."""
    # What JSON cannot read is returned unchanged.
    if isinstance(value, str) and decoded(value) is value:
        return value
    try:
        return json.dumps(value, allow_nan=False, ensure_ascii=False)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"header entry {key!r} is not plain JSON: {error}.", code="picture.header"
        ) from error


def decoded(text: Any) -> Any:
    """The entry that a text of the header represents."""
    try:
        return json.loads(text)
    except (TypeError, ValueError):
        return text


def write_exr(path: str | Path, image: AovImage, *, rgb: str | None = None) -> None:
    """Write an AOV image as OpenEXR (scan lines, RLE, float32).

    Parameters
    ----------
    path
        Name of the file; an existing one is replaced when the new one is complete.
    image
        The image. Its header entries become string attributes ``iriftrace.<key>``: strings
        unchanged, other values as JSON.
    rgb
        A key of `RGB`: its channels are repeated as R, G and B, which the header's entry ``rgb``
        states. `read_exr` leaves them out.

    Raises
    ------
    InputError
        There is no such key, a pixel is NaN or infinite, a header value is not plain JSON, or the
        file cannot be written.
    """
    _refuse_not_finite(image, "cannot be written")
    header = {"compression": OpenEXR.RLE_COMPRESSION, "type": OpenEXR.scanlineimage}
    header.update({PREFIX + key: encoded(key, value) for key, value in image.header.items()})
    # OpenEXR replaces the arrays of the dictionary that it is given, so it gets its own one.
    channels = {
        name: np.ascontiguousarray(image.channels[name]) for name in KNOWN if name in image.channels
    }
    if rgb is not None:
        channels |= colour_channels(channels, rgb)
        header[PREFIX + RGB_ENTRY] = "R, G, B repeat " + ", ".join(RGB[rgb])
    with whole_file(path) as temporary:
        try:
            OpenEXR.File(header, channels, num_threads=THREADS).write(str(temporary))
        except RuntimeError as error:
            raise InputError(f"cannot write {path}: {error}", code="file.not_written") from error


def read_exr(path: str | Path) -> AovImage:
    """Read an AOV image that `write_exr` wrote, or a film of Mitsuba.

    A film writes no more than the channels, so the header of its image has the schema alone: no
    camera and no part, which metrics need.

    Raises
    ------
    InputError
        The file is missing, damaged, not OpenEXR, not from iriftrace, or of a newer schema.
    """
    name = str(path)
    check_exists(Path(path), "give the AOV EXR that a render wrote")
    attributes, channels = exr_content(
        name, "give the AOV EXR that a render wrote, or render it again"
    )
    header = {
        key.removeprefix(PREFIX): decoded(value)
        for key, value in attributes.items()
        if key.startswith(PREFIX) and key != PREFIX + RGB_ENTRY
    }
    known = {key: channels[key] for key in KNOWN if key in channels}
    if not header and str(attributes.get("generatedBy")).startswith("Mitsuba") and known:
        header = {"schema": SCHEMA}
    check_schema(name, header.get("schema"), SCHEMA, "render the scene again")
    image = AovImage(known, header, FileOrigin.of(path))
    _refuse_not_finite(image, f"in {name} is damaged")
    return image


def _refuse_not_finite(image: AovImage, consequence: str) -> None:
    for name, pixels in image.channels.items():
        # The sum is NaN or infinite if a pixel is; it is several times cheaper than a mask.
        with np.errstate(over="ignore", invalid="ignore"):
            suspicious = not np.isfinite(pixels.sum(dtype=np.float64))
        if suspicious:
            count = int(pixels.size - np.isfinite(pixels).sum())
            raise InputError(
                f"channel {name} {consequence}: {count} of its pixels are NaN or infinite, which "
                "would spoil every mean; a quantity that does not exist is 0 with a status code.",
                code="picture.not_finite",
            )


def read_part_of(image: AovImage, path: str | Path | None = None) -> Part:
    """Read the part in the picture, in the world's frame.

    Parameters
    ----------
    path
        Where the part's file is now; by default where it was when the image was rendered.

    Raises
    ------
    InputError
        The header does not name the part, its file is missing, or it is not the file that was
        rendered, so that its face numbers would not fit.
    """
    image.require(*NEEDED)
    named = image.header["part"]
    if not names_part(named):
        raise InputError(
            "The image's header does not say which part it shows; render the scene again.",
            code="picture.no_part",
        )
    file = Path(named["path"] if path is None else path)
    if not file.is_file():
        raise InputError(
            f"The part's file {file} is missing, and face areas and regions come from it; give its "
            "new place.",
            code="file.missing",
            argument="part",
        )
    if sha256_of(file) != named["sha256"]:
        raise InputError(
            f"{file} is not the part the image was rendered with (its SHA-256 differs), so face "
            "numbers would not fit; give the right one or render again.",
            code="file.changed",
            argument="part",
        )
    return read_part(file, ReadPart(length_unit=named["length_unit"])).transformed(
        named["to_world"]
    )
