"""Write files completely or not at all, compute their SHA-256, and check them before reading."""

from __future__ import annotations

import codecs
import hashlib
import io
import json
import math
import os
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from tokenize import TokenError

import numpy as np
from attrs import frozen
from numpy.lib import format as npy

from iriftrace.core.arrays import AnyArray
from iriftrace.core.errors import InputError


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Temporary name to write to; the file is renamed when the block ends without an error.

    The temporary name is in the same folder, which must exist, so that the renaming is one step of
    the file system. It is removed when the block fails or the program is interrupted. A missing
    folder, or an error of the file system, raises InputError.
    """
    target = Path(path)
    if not target.parent.is_dir():
        raise InputError(
            f"cannot write {target}: the folder {target.parent} does not exist; create it first.",
            code="file.no_folder",
        )
    # The suffix stays last, because some writers choose the format by it.
    temporary = target.with_name(f".{target.stem}.{os.getpid()}{target.suffix}")
    try:
        yield temporary
        temporary.replace(target)
    except OSError as error:
        raise InputError(
            f"cannot write {target}: {error.strerror or error}.", code="file.unwritable"
        ) from error
    finally:
        # A file that could not be written need not be removed.
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_whole(path: str | Path, text: str) -> None:
    """Write a text, UTF-8, as in `whole_file`."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: str | Path, values: object) -> None:
    """Write plain values as JSON, as in `whole_file`; InputError if one is none, such as NaN."""
    try:
        text = json.dumps(values, indent=2, allow_nan=False, ensure_ascii=False)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"the values for {path} are not plain JSON: {error}.", code="file.no_json"
        ) from error
    write_whole(path, text + "\n")


def seen_from(folder: Path, file: str | Path) -> str:
    """Relative path to a file with ``/``; the absolute one if it is on another drive of Windows."""
    try:
        return Path(os.path.relpath(file, folder)).as_posix()
    except ValueError:
        return Path(file).absolute().as_posix()


def short_names(paths: Sequence[str | Path]) -> list[str]:
    """Names of files without their folders, unless two have the same."""
    names = [Path(path).name for path in paths]
    return names if len(set(names)) == len(names) else [str(path) for path in paths]


def sha256_of(path: Path) -> str:
    """Hexadecimal SHA-256 of a file's bytes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def make_folder(folder: Path) -> None:
    """Create a folder with those above it if it is missing; InputError if that fails."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot make the folder {folder}: {error.strerror}.",
            code="output.unwritable",
            argument="output",
        ) from error


def saved_at(path: str | Path) -> str:
    """When a file was last changed, ISO 8601, UTC: ``"2025-03-07 12:00:00 UTC"``."""
    return f"{datetime.fromtimestamp(Path(path).stat().st_mtime, UTC):%Y-%m-%d %H:%M:%S} UTC"


@frozen
class FileOrigin:
    """The file that a value was read from, so that results name it."""

    path: str  # absolute, or as it was given
    sha256: str

    @classmethod
    def of(cls, path: str | Path) -> FileOrigin:
        """The origin of what is read from a file now."""
        return cls(str(Path(path).resolve()), sha256_of(Path(path)))

    @property
    def name(self) -> str:
        """Name of the file in its folder."""
        return Path(self.path).name


def sha256_of_list(files: Sequence[Path], folder: Path) -> str:
    """SHA-256 of the list of the checksums of files in a folder, as ``sha256sum`` prints it."""
    lines = [f"{sha256_of(file)}  {file.relative_to(folder).as_posix()}\n" for file in files]
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def check_readable(path: Path) -> None:
    """Refuse a file without read permission, before its content is reported as damaged."""
    if not path.is_file():
        return
    try:
        with path.open("rb"):
            pass
    except OSError as error:
        raise InputError(
            f"Cannot read {path}: {error.strerror or error}.", code="file.unreadable"
        ) from error


def text_in(path: Path) -> str:
    """Text of a file: of Unicode or of Western Windows, without the end mark of DOS."""
    content = path.read_bytes()
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return content.decode("utf-16", errors="replace")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("cp1252", errors="replace")
    return text.rstrip("\x1a").replace("\u2212", "-")  # the sign of a minus in print


MOST_PACKED = 100
"""Bytes that one byte of a compressed file may unpack to: fields and their masks stay below 20."""


def array_in(content: bytes) -> AnyArray:
    """Array of numbers in the bytes of a ``.npy`` file; nothing is unpickled.

    Raises ValueError if it is not such a file, or its size differs from that in its header.
    """
    file = io.BytesIO(content)
    try:
        header = _HEADERS[npy.read_magic(file)]
        shape, by_columns, kind = header(file)
    # The header is Python's syntax, and its parsers have errors of their own.
    except (ValueError, LookupError, TypeError, SyntaxError, TokenError, RecursionError):
        raise ValueError("it holds something else than arrays of numbers") from None
    if kind.hasobject or kind.kind not in "biufV":
        raise ValueError("it holds something else than arrays of numbers")
    stated, there = math.prod(shape) * kind.itemsize, len(content) - file.tell()
    if min(shape, default=0) < 0 or stated != there:
        raise ValueError(f"its header states {stated:,} bytes instead of {there:,}")
    flat = np.frombuffer(content, dtype=kind, offset=file.tell())
    return flat.reshape(shape, order="F" if by_columns else "C").copy()


_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


def arrays_in(path: Path, names: Sequence[str]) -> dict[str, AnyArray]:
    """Arrays of an ``.npz`` file by name, as in `array_in`.

    Also raises ValueError if an array is missing, or the file would unpack to more than
    `MOST_PACKED` times its size.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = {info.filename: info for info in archive.infolist()}
            selected = [members[f"{name}.npy"] for name in names]
            stated, size = sum(info.file_size for info in selected), path.stat().st_size
            if stated > MOST_PACKED * size:
                raise ValueError(f"its {size:,} bytes would unpack to {stated:,}")
            contents = [archive.read(info) for info in selected]
    except KeyError as error:
        raise ValueError(f"{error} is missing") from error
    # NotImplementedError and RuntimeError are those of compressions and encryptions.
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, RuntimeError) as error:
        raise ValueError("it holds something else than arrays of numbers") from error
    return {name: array_in(content) for name, content in zip(names, contents, strict=True)}


def is_number(value: object) -> bool:
    """True for a finite number out of a JSON file, in which true and NaN can stand for one."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < math.inf
