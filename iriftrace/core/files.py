"""Files written whole or not at all, known by their SHA-256, and refused in clear words."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from iriftrace.core.errors import InputError


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Name to write to; the file gets its own name when the block ends without an error.

    Parameters
    ----------
    path
        Final name of the file. Its folder must exist.

    Yields
    ------
    Path
        Temporary name in the same folder, so that the renaming is one step of the file system.
        It is removed when the block fails or the program is interrupted.

    Raises
    ------
    InputError
        The folder does not exist, or the file system refuses the file.
    """
    target = Path(path)
    if not target.parent.is_dir():
        raise InputError(
            f"cannot write {target}: the folder {target.parent} does not exist; create it first."
        )
    # The suffix stays last, because some writers choose the format by it.
    temporary = target.with_name(f".{target.stem}.{os.getpid()}{target.suffix}")
    try:
        yield temporary
        temporary.replace(target)
    except OSError as error:
        raise InputError(f"cannot write {target}: {error.strerror or error}.") from error
    finally:
        # What could not be written need not be removed either.
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def sha256_of(path: Path) -> str:
    """Hexadecimal SHA-256 of a file's bytes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def sha256_of_list(files: Sequence[Path], folder: Path) -> str:
    """SHA-256 of the list of the checksums of files in a folder, as ``sha256sum`` prints it."""
    lines = [f"{sha256_of(file)}  {file.relative_to(folder).as_posix()}\n" for file in files]
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def check_readable(path: Path) -> None:
    """Refuse a file that is there but may not be read, before its content is called damaged.

    Raises
    ------
    InputError
    """
    if not path.is_file():
        return
    try:
        with path.open("rb"):
            pass
    except OSError as error:
        raise InputError(f"Cannot read {path}: {error.strerror or error}.") from error


def numpy_reason(error: Exception) -> str:
    """NumPy's message about a file, without its advice to trust pickled objects."""
    text = " ".join(str(error).split())
    return "it holds something else than arrays of numbers" if "pickle" in text else text
