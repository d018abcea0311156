"""The part that an AOV image was rendered of, found again by what its header says."""

from __future__ import annotations

from pathlib import Path

from iriftrace.core.errors import InputError
from iriftrace.core.files import sha256_of
from iriftrace.image.aov_image import AovImage
from iriftrace.part.part import Part, read_part

_NEEDED = ("part", "camera", "pose", "counts", "assumptions", "time_s")


def part_of_image(image: AovImage, path: str | Path | None = None) -> Part:
    """Read the part an image shows, in the world's frame.

    Parameters
    ----------
    image : AovImage
    path : path, optional
        Where the part's file lies now; by default where it lay when the image was rendered.

    Returns
    -------
    Part

    Raises
    ------
    InputError
        If the image's header says too little, or the file is gone, or it is not the one that was
        rendered: its face numbers would not fit.
    """
    missing = [key for key in _NEEDED if key not in image.header]
    if missing:
        raise InputError(
            f"The image's header has no {', '.join(missing)}: another program wrote it or took "
            "them away, and metrics need them; render the scene again."
        )
    named = image.header["part"]
    file = Path(named["path"] if path is None else path)
    if not file.is_file():
        raise InputError(
            f"The part's file {file} is not there, and face areas and regions come from it; say "
            "where it is with --part."
        )
    if sha256_of(file) != named["sha256"]:
        raise InputError(
            f"{file} is not the part the image was rendered with (its SHA-256 differs), so that "
            "face numbers would not fit; give the right file with --part or render again."
        )
    part = read_part(file, length_unit=named["length_unit"])
    return part.transformed(named["to_world"])
