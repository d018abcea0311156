"""Checks of a command's files, before the computation starts."""

from __future__ import annotations

import json
import os
from pathlib import Path
from tempfile import TemporaryFile

from iriftrace.core.errors import InputError
from iriftrace.core.files import check_readable


def inputs(*paths: Path | None) -> None:
    """Refuse a folder in place of an input file, and a file that cannot be read."""
    for path in paths:
        if path is None:
            continue
        if path.is_dir():
            raise InputError(
                f"The input {path} is a folder, but a file is needed; name the file in it.",
                code="file.is_folder",
            )
        check_readable(path)


def scenes(*paths: Path | None) -> None:
    """Refuse the name of a scene that does not exist, and as `inputs`."""
    from iriftrace.tracing.file import require_scene

    inputs(*paths)
    for path in filter(None, paths):
        require_scene(path)


def fields(*paths: Path) -> None:
    """Refuse a folder that is not an OpenFOAM case in place of a field, and an unreadable file."""
    from iriftrace.io.members import reader_of

    for path in paths:
        if path.is_dir():
            reader_of(path)
        check_readable(path)


def order(field: Path, part: Path) -> None:
    """Refuse a field and a part whose names show that they are exchanged."""
    from trimesh import available_formats

    from iriftrace.io.members import COMPRESSED, SUFFIXES

    meshes = {f".{name}" for name in available_formats()}.difference(COMPRESSED)
    first, second = field.suffix.lower(), part.suffix.lower()
    wrong = ""
    if first in meshes and second not in meshes:
        wrong = f"{field} is not a field"
    elif second in SUFFIXES and first not in SUFFIXES and not field.is_dir():
        wrong = f"{part} is not a part"
    if wrong:
        raise InputError(
            f"{wrong} that can be read here; field and part may be exchanged.",
            code="file.exchanged",
        )


def folder(path: Path) -> None:
    """Refuse a folder that cannot be written."""
    there = next(each for each in (path, *path.absolute().parents) if each.exists())
    if not there.is_dir():
        raise InputError(
            f"Cannot use {path} as a folder: {there} is a file; name another one.",
            code="file.no_folder",
        )
    try:
        # Permissions do not show that a file system is read-only or full.
        with TemporaryFile(dir=there):
            pass
    except OSError as error:
        raise InputError(
            f"The folder {there} may not be written; name another one.", code="output.unwritable"
        ) from error


def numbers(path: Path, schema: str) -> None:
    """Refuse an output if the numbers (.json) next to it would replace another file.

    A file of the same schema, an earlier result, may be replaced.
    """
    report = path.with_suffix(".json")
    # Other than the path's own method, this takes names that are too long.
    if not os.path.exists(report) or report.stat().st_size == 0:
        return
    try:
        found = str(json.loads(report.read_text(encoding="utf-8"))["schema"])
    except (OSError, ValueError, LookupError, TypeError):
        found = ""
    if not found.startswith(f"{schema}/"):
        raise InputError(
            f"The numbers of {path} are written to {report}, another file that would be lost; "
            "give the output another name.",
            code="output.replaces",
            argument="output",
        )


def kept(path: Path | None, *read: Path | str) -> None:
    """Refuse an output that would replace one of its inputs."""
    for one in read:
        if path is not None and path.resolve() == Path(one).resolve():
            raise InputError(
                f"The output would replace {path}, one of its inputs; give it another name.",
                code="output.replaces",
            )


def output(path: Path | None, example: str, *others: str, make: bool = False) -> None:
    """Refuse an output file, if one is requested, that cannot be written.

    Its name must end as that of `example` or in one of the others, since other files are named
    after it; `make` states whether its folder would be made.
    """
    if path is None:
        return
    suffixes = tuple(dict.fromkeys((Path(example).suffix, *others)))
    if path.is_dir():
        raise InputError(
            f"The output {path} is a folder; name a file in it, such as {path / example}.",
            code="file.is_folder",
        )
    if path.suffix.lower() not in suffixes:
        raise InputError(
            f"The output {path} must end in {' or '.join(suffixes)}; name it "
            f"{path.with_name((path.stem or 'out') + suffixes[0])}, for example.",
            code="file.ending",
        )
    if not make:
        parent(path)
    folder(path.parent)


def parent(path: Path) -> None:
    """Refuse a file or folder whose own folder does not exist."""
    if not path.absolute().parent.is_dir():
        raise InputError(
            f"The folder {path.parent} does not exist; create it first.", code="file.no_folder"
        )


def cloud_output(path: Path, example: str) -> None:
    """Refuse a cloud that cannot be written."""
    from iriftrace.io.cloud_write import WRITTEN, check_cloud_name

    output(path, example, *WRITTEN)
    check_cloud_name(path)
