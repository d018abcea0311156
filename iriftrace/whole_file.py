"""Write a file whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from iriftrace.errors import InputError


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
