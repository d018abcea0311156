"""The numbers of a comparison of measured and simulated shifts, as JSON."""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iriftrace.comparison import Comparison, Picture
from iriftrace.exr import AovImage
from iriftrace.measured_shift import MeasuredShift
from iriftrace.whole_file import whole_file

FloatArray = NDArray[np.float64]

SCHEMA = "iriftrace.comparison/1"
CONVENTION = (
    "shift: position in the hot picture minus position in the cold one, px, u right, v down; in "
    "files (0, 0) is the centre of the first pixel; residual: measured minus simulated; camera "
    "motion: from cold to hot, in the camera's frame (x right, y down, z forward)"
)


def comparison_report(
    comparison: Comparison,
    image: AovImage,
    image_file: dict[str, Any],
    measured: MeasuredShift,
    positions: Picture,
) -> dict[str, Any]:
    """All numbers of a comparison, as plain JSON values.

    Parameters
    ----------
    comparison : Comparison
    image : AovImage
        The rendering, whose header is copied.
    image_file : dict
        Path and SHA-256 of its file.
    measured : MeasuredShift
    positions : str
    """
    residual = comparison.residual
    copied = ("camera", "pose", "wavelength_nm", "field", "part", "engine", "assumptions")
    return {
        "schema": SCHEMA,
        "version": version("iriftrace"),
        "image": image_file,
        "measured": {
            "path": str(Path(measured.path).resolve()),
            "sha256": measured.sha256,
            "kind": "markers" if measured.resolution is None else "map",
            "positions": positions,
        },
        "convention": CONVENTION,
        "points": {
            "measured": len(measured.places),
            "compared": len(residual),
            "without_simulation": comparison.left_out,
        },
        "measured_px": _lengths(comparison.measured),
        "simulated_px": _lengths(comparison.simulated),
        "residual_px": {"bias": residual.mean(axis=0).tolist(), **_lengths(residual)},
        "correlation": correlation(comparison.measured, comparison.simulated),
        "camera_motion": _motion(comparison),
        **{key: image.header.get(key) for key in copied},
    }


def _lengths(vectors: FloatArray) -> dict[str, float]:
    lengths = np.linalg.norm(vectors, axis=1)
    return {
        "rms": float(np.sqrt((lengths**2).mean())),
        "median": float(np.median(lengths)),
        "p95": float(np.percentile(lengths, 95)),
        "max": float(lengths.max()),
    }


def correlation(one: FloatArray, other: FloatArray) -> float | None:
    """Pearson's coefficient of both components together; None if one of the fields is constant."""
    a, b = ((field - field.mean(axis=0)).ravel() for field in (one, other))
    scale = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / scale if scale > 0 else None


def _motion(comparison: Comparison) -> dict[str, Any]:
    motion = comparison.motion
    if motion is None:
        return {"reason": comparison.no_motion}
    cleaned = comparison.measured - motion.shifts
    used = motion.used
    return {
        "translation_um": (1e3 * motion.translation_mm).tolist(),
        "translation_std_um": (1e3 * motion.deviations[:3]).tolist(),
        "rotation_urad": (1e6 * motion.rotation_rad).tolist(),
        "rotation_std_urad": (1e6 * motion.deviations[3:]).tolist(),
        "uncertainty": "one standard deviation, as if residuals were independent of each other",
        "points": int(used.sum()),
        "outliers": int((~used).sum()),
        "rms_before_px": motion.rms_before_px,
        "rms_after_px": motion.rms_after_px,
        "explained": motion.explained,
        "correlation_after": correlation(cleaned[used], comparison.simulated[used]),
    }


def write_comparison(path: str | Path, report: dict[str, Any]) -> None:
    """Write the numbers as JSON, whole or not at all."""
    text = json.dumps(report, indent=2, allow_nan=False, ensure_ascii=False)
    with whole_file(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
