"""Why a file cannot be read, in words that help whoever gave it."""

from __future__ import annotations

from pathlib import Path

from iriftrace.errors import InputError


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
    """What NumPy says of a file, without its advice to trust it.

    What does not begin like a NumPy file is taken for pickled objects, which are never loaded.
    """
    text = " ".join(str(error).split())
    return "it holds something else than arrays of numbers" if "pickle" in text else text
