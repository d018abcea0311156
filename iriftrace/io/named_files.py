"""Files that are read with another one: those that it names, and those of an OpenFOAM case."""

from __future__ import annotations

import re
from collections.abc import Iterator
from glob import glob
from pathlib import Path

from iriftrace.core.files import text_in

BODIES = "bodies"
"""Folder next to a field: copies of the bodies around which it was solved, in mm, world."""

_QUOTED = (".pvd", ".series", ".vtm", ".pvtu", ".xdmf", ".xmf", ".gltf")
_ENSIGHT = (".case", ".encas")
_OPENFOAM = (".foam", ".openfoam")

_TEXT = re.compile(r""""([^"\n]*)"|'([^'\n]*)'|>([^<>]{1,999})<""")
"""A value in quotes, or an XML element's content, such as ``air.h5:/T``."""


def named_files(path: Path) -> tuple[Path, ...]:
    """Files that are read with this one, sorted; of an OpenFOAM case those of all its times.

    Empty for a file that names no others, and for a folder that is no case.
    """
    suffix = path.suffix.lower()
    if path.is_dir() or suffix in _OPENFOAM or path.name == "controlDict":
        return tuple(sorted(_in_case(path)))
    found: set[Path] = set()
    waiting = [path]
    while waiting:
        new = {file for file in _named_in(waiting.pop()) if file not in found and file != path}
        found |= new
        waiting += new
    return tuple(sorted(found))


def _in_case(path: Path) -> Iterator[Path]:
    """Files of the meshes and times of a case, also if the path is ``constant/<region>``."""
    from iriftrace.io.openfoam import processor_folders, time_folders

    folder = path.absolute()
    if not path.is_dir():
        folder = folder.parent.parent if path.name == "controlDict" else folder.parent
    if folder.parent.name == "constant":
        folder = folder.parent.parent
    for piece in (folder, *processor_folders(folder)):
        for place in (piece / "constant", *time_folders(piece).values()):
            yield from (file for file in place.rglob("*") if file.is_file())


def _named_in(path: Path) -> Iterator[Path]:
    """Existing files that one file names itself."""
    suffix = path.suffix.lower()
    names: set[str] = set()
    if suffix in _QUOTED:
        for *quoted, content in _TEXT.findall(text_in(path)):
            names.update((*quoted, content.partition(":")[0].strip()))
        # As Windows separates folders.
        names |= {name.replace("\\", "/") for name in names}
    elif suffix in _ENSIGHT:
        # Asterisks stand for the number of a step.
        words = {word.strip('"') for word in text_in(path).split()}
        patterns = [re.sub(r"\*+", "*", word) for word in words if re.search(r"[^*/.]", word)]
        names = {file for word in patterns for file in glob(word, root_dir=path.parent)}
    for name in names:
        file = path.parent / name
        try:
            if file.is_file():
                yield file
        except (OSError, ValueError):  # a text that no name can be
            continue
