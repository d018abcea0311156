"""What the program checks before it works, and how it says what is wrong."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile

from cyclopts import CycloptsError, MissingArgumentError
from cyclopts.exceptions import UnusedCliTokensError

from iriftrace.errors import InputError
from iriftrace.unreadable import check_readable


def sentence(error: Exception) -> str:
    """An error as the program shows it: on one line, from a capital letter to a full stop."""
    if isinstance(error, CycloptsError):
        return _of_the_command_line(error)
    if isinstance(error, MemoryError):
        return (
            "This needs more memory than the machine has; use fewer pixels, shells or cells, such "
            "as -D scale=0.25 or --layers 13."
        )
    if isinstance(error, OSError):
        return f"Cannot read or write {error.filename}: {error.strerror}."
    text = " ".join(str(error).split())
    first = re.match(r"([a-z]+) (?!- )", text)
    # A file's name or a symbol such as n at the beginning keeps its own spelling.
    if first and not Path(first[1]).exists():
        text = text[0].upper() + text[1:]
    return text if text.endswith((".", "!", "?")) else text + "."


def _of_the_command_line(error: CycloptsError) -> str:
    command = " ".join(("iriftrace", *(error.command_chain or ())))
    text = " ".join(str(error).split())
    if isinstance(error, UnusedCliTokensError):
        text = f"There are words too many: {' '.join(error.unused_tokens or ())}."
    elif isinstance(error, MissingArgumentError) and error.argument and error.keyword is None:
        name = error.argument.names[0]
        positional = error.argument.index is not None
        text = f"`{command}` needs {name.removeprefix('--').upper() if positional else name}."
    return f"{text} See `{command} --help`."


def check_input(*paths: Path | None) -> None:
    """Refuse a folder where a file is read, and a file that may not be read.

    Raises
    ------
    InputError
    """
    for path in paths:
        if path is None:
            continue
        if path.is_dir():
            raise InputError(
                f"The input {path} is a folder, but a file is needed; name the file in it."
            )
        check_readable(path)


def check_field(*paths: Path) -> None:
    """Refuse a folder that is no OpenFOAM case where a field is read, and an unreadable file.

    Raises
    ------
    InputError
    """
    from iriftrace.readers.kinds import kind_of

    for path in paths:
        if path.is_dir():
            kind_of(path)
        check_readable(path)


def check_order(field: Path, part: Path) -> None:
    """Refuse a field and a part that change places, as their names say.

    Raises
    ------
    InputError
    """
    from trimesh import available_formats

    from iriftrace.readers.kinds import COMPRESSED, SUFFIXES

    meshes = {f".{name}" for name in available_formats()}.difference(COMPRESSED)
    first, second = field.suffix.lower(), part.suffix.lower()
    wrong, what = "", ""
    if first in meshes and second not in meshes:
        wrong, what = str(field), "field"
    elif second in SUFFIXES and first not in SUFFIXES and not field.is_dir():
        wrong, what = str(part), "part"
    if wrong:
        raise InputError(
            f"{wrong} is no {what} that can be read here; are field and part in the wrong order?"
        )


def check_folder(folder: Path) -> None:
    """Refuse before the work a folder that could not be written after it.

    Raises
    ------
    InputError
        If it is a file, lies in one, or may not be written.
    """
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not there.is_dir():
        raise InputError(f"Cannot use {folder} as a folder: {there} is a file; name another one.")
    try:
        # Permissions do not tell of file systems that are read-only or full.
        with TemporaryFile(dir=there):
            pass
    except OSError as error:
        raise InputError(f"The folder {there} may not be written; name another one.") from error


def check_output(path: Path, suffix: str, example: str, *, make: bool = True) -> None:
    """Refuse before the work a file that could not be written after it.

    Parameters
    ----------
    path : Path
    suffix : str
        What its name must end in: the program's other files are named after it.
    example : str
        Name to propose.
    make : bool
        Whether its folder would be made.

    Raises
    ------
    InputError
    """
    if path.is_dir():
        raise InputError(
            f"The output {path} is a folder; name a file in it, such as {path / example}."
        )
    if path.suffix.lower() != suffix:
        raise InputError(
            f"The output {path} must end in {suffix}; name it "
            f"{path.with_name((path.stem or 'out') + suffix)}, for example."
        )
    if not make and not path.parent.is_dir():
        raise InputError(f"The folder {path.parent} does not exist; create it first.")
    check_folder(path.parent)


@contextmanager
def removed_on_failure(folder: Path) -> Iterator[None]:
    """Remove a folder that was not there before, with the parents made for it, if work fails."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        yield
    except BaseException:
        if missing:
            shutil.rmtree(missing[-1], ignore_errors=True)
        raise
