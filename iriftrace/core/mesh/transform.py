"""Rigid motions and scalings written as text, for files whose axes or units differ."""

from __future__ import annotations

import math
import os
import re
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.files import check_readable, text_in
from iriftrace.core.units import length_factor, length_unit_of

_AXES = {"x": 0, "y": 1, "z": 2}
_OTHERS = (
    "(?:w|world|object|part|cad|reference|nominal|board|target|workpiece|base|robot|gripper|flange"
    "|tool|tcp)"
)
_CAMERA = "(?:c|cam|camera|sensor|scanner|cloud|scan|measured|actual)"


_TO_CAMERA = re.compile(
    rf"(?<![^\W_])(?:(?<!distance )(?<!distance from ){_OTHERS}(?:'s)?(?:[\s_-]*\d"
    rf"|[\s_-]+(?:frame|coord\w*|system))*(?:[\s_-]*(?:to|->|→)[\s_-]*|2)(?:the )?{_CAMERA}"
    rf"|{_OTHERS}(?:'s)? (?:pose|position) in (?:the )?{_CAMERA}"
    rf"|(?<=pose of the ){_OTHERS} in (?:the )?{_CAMERA}"
    rf"|[RT]_?{_CAMERA}_?{_OTHERS})(?![^\W_])",
    re.IGNORECASE,
)
_VIEW = re.compile(
    rf"(?<![a-z])(?:(?-i:c[TM][wo])|model_?view|view[ _]?matri(?:x|ces)"
    rf"|cam(?:era)?_(?:from|T)_{_OTHERS})(?![a-z])",
    re.IGNORECASE,
)
_FORMS = "'rotate x 90', 'scale 0.001', 'translate 1 2 3', 16 numbers, or a file with 16 numbers"


def parse_transform(text: str) -> FloatArray:
    """Read a (4, 4) matrix, which acts on column vectors (x, y, z, 1), from text.

    The text has comma-separated steps, the left one applied first: ``rotate x 90`` (degrees,
    counter clockwise seen from the tip of the axis), ``scale 2`` or ``scale 1 1 -1``, ``translate 1
    2 3`` (mm). Or the 16 numbers of a matrix, row by row (12 without the row 0 0 0 1), or the path
    of a text file that holds them, next to brackets and comments, of which one may state the unit
    of the translation (``# unit: m``).

    Raises InputError for none of these, a matrix that is singular, not affine or no rotation (times
    a scale), a rotation in radians, or a file that cannot be read.
    """
    path = Path(text.strip())
    numbers, unit = _numbers(text), "mm"
    # Other than the path's own method, this takes any text.
    if numbers is None and os.path.isfile(path):
        written = text_in(path)
        unit = length_unit_of(written.splitlines(), path.name) or "mm"
        numbers = _numbers(_bare(written))
        if numbers is None:
            raise InputError(
                f"{path} does not hold a transform: expected 16 numbers, row by row.",
                code="transform.number_count",
            )
    elif numbers is None and path.suffix and len(text.split()) == 1:
        raise InputError(
            f"The transform's file {path} does not exist; check the path.", code="transform.no_file"
        )
    matrix = np.eye(4)
    if numbers is None:
        for step in text.split(","):
            matrix = _step(step) @ matrix
    elif len(numbers) in (12, 16):
        rows = np.array((*numbers, 0.0, 0.0, 0.0, 1.0)[:16]).reshape(4, 4)
        matrix = checked_matrix(rows, repr(text))
        _refuse_distorting(matrix, text)
        matrix[:3, 3] *= length_factor(unit)
    else:
        raise InputError(
            f"The transform {text!r} has {len(numbers)} numbers; a 4x4 matrix has 16, row by row "
            "(12 without its last row), with decimal points.",
            code="transform.number_count",
        )
    return checked_matrix(matrix, repr(text))


def stated_to_camera(text: str) -> str:
    """Words by which a text states that a motion leads to a camera; "" for none.

    ``T_A_B`` leads from B to A.
    """
    match = _TO_CAMERA.search(text) or _VIEW.search(text)
    return match[0] if match else ""


def _refuse_distorting(matrix: FloatArray, name: str) -> None:
    """Refuse a matrix that is not a rotation times one scale; most likely it was mistyped."""
    lengths = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    if np.linalg.det(matrix[:3, :3]) < 0 or lengths.max() > (1.0 + 2 * ROUNDING) * lengths.min():
        raise InputError(
            f"The matrix {name!r} is not a rotation: it mirrors, shears or scales (lengths by "
            f"factors from {lengths.min():.6g} to {lengths.max():.6g}); correct it, or write steps "
            "if that is meant ('scale 1 1 -1').",
            code="transform.distorts",
        )
    decades = math.log10(lengths.mean())
    if abs(decades - round(decades)) > ROUNDING:
        warn(
            f"The matrix {name!r} scales lengths by {lengths.mean():.6g}, which is not a change of "
            "mm to cm or m; if it is that of an alignment, align without scale."
        )


def read_motion(path: str | Path) -> FloatArray:
    """The rigid motion in a text file, (4, 4) array, mm, that takes points from a camera's frame.

    Raises InputError as `parse_transform`, and if the file says that it leads to the camera.
    """
    file = Path(path)
    check_readable(file)
    if file.is_file() and (said := stated_to_camera(text_in(file))):
        raise InputError(
            f"{file} says {said!r}, but it has to take points the other way, from the camera's "
            "frame; write the inverse matrix, or leave out these words if it is meant.",
            code="transform.to_camera",
        )
    return rigid_motion(parse_transform(str(file)), str(file))


ROUNDING = 2e-4
"""Largest relative change of lengths by numbers that have four decimals."""


def rigid_motion(matrix: FloatArray, name: str) -> FloatArray:
    """The rotation and translation that a (4, 4) matrix of rounded numbers is.

    Raises InputError for a matrix that scales, shears or mirrors; `name` is used in messages.
    """
    left, lengths, right = np.linalg.svd(matrix[:3, :3])
    if np.linalg.det(matrix[:3, :3]) < 0 or np.abs(lengths - 1.0).max() > ROUNDING:
        raise InputError(
            f"{name} is not a rigid motion: it mirrors, shears or scales (lengths by factors from "
            f"{lengths.min():.6g} to {lengths.max():.6g}), and would change what was measured; "
            "align the cloud by rotation and translation alone.",
            code="transform.not_rigid",
        )
    motion = matrix.copy()
    motion[:3, :3] = left @ right
    return motion


def nearest_rotations(axes: FloatArray) -> FloatArray:
    """Rotations nearest to matrices (n, 3, 3) that rounding has distorted; (n, 3, 3) array.

    Those that are rotations to 1e-12 are returned as they are.
    """
    products = np.swapaxes(axes, 1, 2) @ axes
    rounded = np.abs(products - np.eye(3)).max(axis=(1, 2)) > 1e-12
    left, _, right = np.linalg.svd(axes[rounded])
    nearest = axes.copy()
    nearest[rounded] = left @ right
    return nearest


def apply(matrix: FloatArray, points: FloatArray) -> FloatArray:
    """Points (n, 3) moved by a (4, 4) affine matrix; (n, 3) array, float64."""
    return np.asarray(points, dtype=np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def checked_matrix(matrix: ArrayLike, name: str = "") -> FloatArray:
    """A (4, 4) matrix, called `name` in messages; an InputError if not affine and invertible."""
    affine = np.asarray(matrix, dtype=np.float64)
    called = f"The transform {name}".rstrip()
    if affine.shape != (4, 4):
        raise InputError(
            f"{called} has the shape {affine.shape}; give a 4 x 4 matrix.", code="transform.shape"
        )
    if not np.isfinite(affine).all():
        raise InputError(
            f"{called} holds a number that is not finite; correct it.", code="transform.not_finite"
        )
    if not np.array_equal(affine[3], (0.0, 0.0, 0.0, 1.0)):
        raise InputError(
            f"{called} does not end with the row 0 0 0 1; is the matrix transposed?",
            code="transform.last_row",
        )
    scale = float(np.abs(affine[:3, :3]).max())
    if not abs(np.linalg.det(affine[:3, :3])) > 1e-9 * scale**3:
        raise InputError(
            f"{called} is singular: it would flatten the shape; give an invertible one, with no "
            "factor of 0.",
            code="transform.singular",
        )
    return affine


def _bare(text: str) -> str:
    """A file's text without comments, a name before its matrix, and decimal commas."""
    bare = re.sub(r"(?:#|%|//).*", "", text)
    bare = re.sub(r"^\s*\w+\s*[=:]|\barray\b", "", bare)
    # As many words with commas in them are numbers between blanks or semicolons.
    words = re.findall(r"[^\s;\[\](){}]+", bare)
    decimal = len(words) in (12, 16) and "." not in bare and all(w.strip(",") == w for w in words)
    return bare.replace(",", ".") if decimal else bare


def _numbers(text: str) -> list[float] | None:
    """The numbers in a text, without brackets; None if it holds anything else."""
    try:
        words = re.split(r"[\s,;\[\](){}]+", text)
        return [float(word) for word in words if word] or None
    except ValueError:
        return None


def _step(step: str) -> FloatArray:
    matrix = np.eye(4)
    match step.split():
        case ["rotate", axis, angle] if axis in _AXES:
            matrix[:3, :3] = _rotation(_AXES[axis], _radians(angle, step))
        case ["scale", factor]:
            matrix[:3, :3] *= _number(factor, step)
        case ["scale", *factors] if len(factors) == 3:
            matrix[:3, :3] = np.diag([_number(factor, step) for factor in factors])
        case ["translate", *shift] if len(shift) == 3:
            matrix[:3, 3] = [_number(value, step) for value in shift]
        case _:
            raise InputError(
                f"The transform step {step.strip()!r} is not known; use {_FORMS}.",
                code="transform.unknown_step",
            )
    return matrix


def _number(word: str, step: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise InputError(
            f"{word!r} in the transform step {step.strip()!r} is not a number; use {_FORMS}.",
            code="transform.no_number",
        ) from None


def _radians(word: str, step: str) -> float:
    """An angle in degrees; 1.5708, which is a quarter turn in radians, is refused."""
    degrees = _number(word, step)
    quarters = degrees / (math.pi / 2)
    if degrees and round(quarters) and abs(degrees) < 7 and abs(quarters - round(quarters)) < 5e-4:
        raise InputError(
            f"{word} in the transform step {step.strip()!r} is {90 * round(quarters)} degrees in "
            "radians; give degrees.",
            code="transform.radians",
        )
    return math.radians(degrees)


def _rotation(axis: int, angle: float) -> FloatArray:
    """Rotation about a coordinate axis; quarter turns are exact, so that axes stay axes."""
    cosine, sine = math.cos(angle), math.sin(angle)
    quarters = angle / (math.pi / 2)
    if abs(quarters - round(quarters)) < 1e-12:
        cosine, sine = float(round(cosine)), float(round(sine))
    rotation = np.eye(3)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    rotation[[first, second], [first, second]] = cosine
    rotation[first, second], rotation[second, first] = -sine, sine
    return rotation
