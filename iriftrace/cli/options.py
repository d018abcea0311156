"""Options that several commands share, and how their values are read."""

from __future__ import annotations

import math
import re
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile
from typing import Annotated, Any

from cyclopts import CycloptsError, MissingArgumentError, Parameter, Token
from cyclopts.exceptions import UnusedCliTokensError

from iriftrace.core.errors import InputError
from iriftrace.core.files import check_readable

# No option of the program begins with a digit.
_NEGATIVE = re.compile(r"-\.?\d")


def with_negative_values(words: Sequence[str]) -> list[str]:
    """The command line with options joined to negative values: ``--ambient=-10 degC``.

    Cyclopts knows -10 for a number, but takes -10 degC and -50,-100,120 for options.
    """
    joined: list[str] = []
    for word in words:
        takes = bool(joined) and joined[-1].startswith("--") and "=" not in joined[-1]
        if takes and _NEGATIVE.match(word):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def numbers(text: str, count: int, option: str, separator: str = ",") -> list[float]:
    """Numbers of a compound option; InputError when there are more or fewer, or one is NaN."""
    try:
        values = [float(piece) for piece in text.split(separator)]
    except ValueError:
        values = []
    if len(values) != count or any(math.isnan(value) for value in values):
        raise InputError(
            f'{option} is "{text}", but {count} numbers separated by "{separator}" are needed.'
        )
    return values


def finite_numbers(text: str, count: int, option: str) -> list[float]:
    """Numbers of a compound option, none of which may be infinite."""
    values = numbers(text, count, option)
    if any(math.isinf(value) for value in values):
        raise InputError(f'{option} is "{text}", but its numbers must be finite.')
    return values


def quantity(text: str, unit: str, option: str) -> float:
    """A number with or without a unit; the error names the option."""
    from iriftrace.core.units import parse_quantity

    try:
        value = parse_quantity(text, unit)
    except InputError as error:
        raise InputError(f"{option}: {error}") from error
    if unit == "kelvin" and value < 0.0:
        raise InputError(f"{option}: {text!r} is below absolute zero; check number and unit.")
    return value


def quantity_with_unit(text: str, unit: str, option: str, example: str) -> float:
    """A quantity that users think of in another unit than the library's, so a number needs one."""
    try:
        float(text)
    except ValueError:
        return quantity(text, unit, option)
    raise InputError(f'{option} is "{text}" without a unit; write it with one, like "{example}".')


def optional_quantity(text: str | None, unit: str, option: str) -> float | None:
    """The same of an option that may be left out."""
    return None if text is None else quantity(text, unit, option)


def _whole(_type: Any, tokens: Sequence[Token]) -> int:
    """A whole number; the default conversion would cut 2.5 to 2."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f'"{tokens[0].value}" is not a whole number.') from None


Whole = Annotated[int, Parameter(converter=_whole)]


Variables = Annotated[
    list[str] | None,
    Parameter(
        name=["-D", "--define"], negative=(), help="Scene parameter, name=value; repeatable."
    ),
]


def variables_of(definitions: list[str] | None) -> dict[str, str]:
    """Scene parameters by name."""
    values = {}
    for text in definitions or []:
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise InputError(f'-D is "{text}"; write it as name=value, such as -D scale=0.25.')
        values[name] = value
    return values


Wavelength = Annotated[
    str | None,
    Parameter(help='Wavelength of the light, "450 nm"; by default the one the scene was made for.'),
]


def scene_variables(definitions: list[str] | None, wavelength: str | None) -> dict[str, str]:
    """Scene parameters by name, the wavelength (nm) among them if it is given."""
    values = variables_of(definitions)
    if wavelength is not None:
        values["wavelength"] = f"{quantity(wavelength, 'nm', '--wavelength')!r}"
    return values


Statuses = Annotated[
    list[Whole] | None,
    Parameter(
        negative=(),
        help="Further status codes whose rays the metrics use, such as 5; repeatable.",
    ),
]


def statuses(include: list[int] | None) -> tuple[int, ...]:
    """Status codes of the rays that the metrics use."""
    from iriftrace.image.aov_image import Status

    known = [status.value for status in Status]
    wrong = [code for code in include or () if code not in known]
    if wrong:
        meanings = ", ".join(f"{status.value} {status.key}" for status in Status)
        raise InputError(f"--include {wrong[0]} is no status of a ray; the codes are {meanings}.")
    return (0, *(include or ()))


# MERGE cli.checks: What the program checks before it works, and how it says what is wrong.


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
    from iriftrace.field.readers.members import kind_of

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

    from iriftrace.field.readers.members import COMPRESSED, SUFFIXES

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
