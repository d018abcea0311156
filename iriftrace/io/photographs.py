"""Files of photographs: 16-bit TIFF, the truth as EXR, and a text with the numbers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iriftrace.core.errors import InputError
from iriftrace.core.files import make_folder, whole_file, write_whole
from iriftrace.core.plain import JsonObject
from iriftrace.image.aov_image import KNOWN, AovImage
from iriftrace.io.exr import write_exr

TRUTH, NUMBERS = "truth.exr", "README.md"

TITLE = "# Photographs"
"""First line of `NUMBERS`, by which earlier photographs are known that may be replaced."""


def write_tiff(path: str | Path, picture: NDArray[np.uint16]) -> None:
    """Write a grey picture (h, w) with 16 bits, as in `whole_file`."""
    from PIL import Image

    with whole_file(path) as temporary:
        Image.fromarray(picture).save(temporary, format="TIFF")


def picture_files(path: Path, names: Mapping[str, object]) -> dict[str, Path]:
    """File of each picture: that of the hot one, or the only one, has no name of its own."""
    plain = "hot" if "hot" in names else next(iter(names)) if len(names) == 1 else None
    return {
        name: path if name == plain else path.with_name(f"{path.stem}_{name}{path.suffix}")
        for name in names
    }


def check_folder(folder: Path) -> None:
    """Raise InputError if files of a folder that are no earlier photographs' would be lost."""
    text, truth = folder / NUMBERS, folder / TRUTH
    ours = text.is_file() and text.read_bytes().startswith(TITLE.encode())
    lost = next((file for file in (text, truth) if file.exists()), None)
    if lost is not None and not ours:
        raise InputError(
            f"Photographs fill a folder of their own, and {lost}, another file, would be lost; "
            "give a picture in a new folder.",
            code="output.replaces",
            argument="output",
        )


def write_photographs(
    path: Path, pictures: Mapping[str, NDArray[np.uint16]], truth: AovImage, numbers: JsonObject
) -> list[Path]:
    """Write pictures, `TRUTH` and `NUMBERS` into the folder of a file; see `Photograph.save`."""
    if path.suffix.lower() not in (".tif", ".tiff"):
        raise InputError(
            f"The picture {path} must end in .tiff, as its pixels have 16 bits; name it "
            f"{path.with_suffix('.tiff')}.",
            code="file.ending",
            argument="output",
        )
    check_folder(path.parent)
    make_folder(path.parent)
    files = picture_files(path, pictures)
    for name, picture in pictures.items():
        write_tiff(files[name], picture)
    write_exr(path.parent / TRUTH, truth)
    listed = {name: file.name for name, file in files.items()}
    write_whole(path.parent / NUMBERS, _text(listed, truth, numbers))
    return [*files.values(), path.parent / TRUTH, path.parent / NUMBERS]


def _text(files: Mapping[str, str], truth: AovImage, numbers: JsonObject) -> str:
    """What the pictures show, as Markdown."""
    width, height = truth.camera.resolution
    scene = truth.header["scene"]
    channels = [name for name in KNOWN if name in truth.channels]
    lines = [
        TITLE,
        "",
        f"{width} x {height} px, 16 bits, simulated by iriftrace {truth.header['version']}.",
        "",
        *(f"- `{file}`: {name.replace('_', ' ')}" for name, file in files.items()),
        f"- `{TRUTH}`: the truth at the pixels' centres: {', '.join(channels)}",
        "",
        f"Scene: {scene['path'] or 'objects in memory'} (SHA-256 {scene['sha256'] or 'none'}), "
        f"{', '.join(f'{k}={v}' for k, v in scene['variables'].items()) or 'as it is'}.",
        "",
        "| quantity | value |",
        "|---|---|",
    ]
    for key, value in numbers.items():
        pairs = value.items() if isinstance(value, dict) else [("", value)]
        lines += [f"| {f'{key} {name}'.strip()} | {_shown(each)} |" for name, each in pairs]
    return "\n".join([*lines, ""])


def _shown(value: object) -> str:
    return ", ".join(map(_shown, value)) if isinstance(value, list) else str(value)
