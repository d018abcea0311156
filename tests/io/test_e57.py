"""Clouds in E57 files: points, units, poses and damage; written by pye57."""

import sys
from pathlib import Path

import numpy as np
import pye57
import pytest

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io import e57
from iriftrace.io.clouds import read_cloud

SINGLE_MM = 8e-6
"""Rounding of coordinates below 0.13 m, which pye57 writes in single precision."""

POINTS = np.random.default_rng(3).uniform(-80, 80, (500, 3))


def write(path: Path, scans: int = 1, **pose: np.ndarray) -> Path:
    """Scans of the points, which the file has in metres."""
    with pye57.E57(str(path), mode="w") as file:
        axes = {f"cartesian{axis}": POINTS[:, i] / 1e3 for i, axis in enumerate("XYZ")}
        for _ in range(scans):
            file.write_scan_raw(axes, **pose)
    return path


@pytest.mark.parametrize(("unit", "factor"), [(None, 1.0), ("m", 1.0), ("mm", 1e-3)])
def test_points_are_in_metres_unless_told_otherwise(
    tmp_path: Path, unit: str | None, factor: float
) -> None:
    read = read_cloud(write(tmp_path / "c.e57"), length_unit=unit).points
    np.testing.assert_allclose(read, factor * POINTS, atol=SINGLE_MM)


def test_points_at_the_scanners_origin_were_not_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = POINTS.copy()
    rows[[3, 40, 41]] = 0.0
    monkeypatch.setattr(sys.modules[__name__], "POINTS", rows)
    pose = {"rotation": np.array([1.0, 0, 0, 0]), "translation": np.array([0.01, 0, 0])}
    file = write(tmp_path / "c.e57", **pose)
    with pytest.warns(IriftraceWarning, match="3 of 500 points .* left out"):
        read = read_cloud(file).points
    shifted = np.delete(rows, [3, 40, 41], axis=0) + np.array((10.0, 0.0, 0.0))
    np.testing.assert_allclose(read, shifted, atol=SINGLE_MM)


def test_pose_of_the_scan_is_applied(tmp_path: Path) -> None:
    """A quarter turn about z and a shift of 10 mm."""
    half = np.sqrt(0.5)
    pose = {"rotation": np.array([half, 0, 0, half]), "translation": np.array([0.01, 0, 0])}
    read = read_cloud(write(tmp_path / "c.e57", **pose)).points
    turned = np.column_stack((-POINTS[:, 1] + 10, POINTS[:, 0], POINTS[:, 2]))
    np.testing.assert_allclose(read, turned, atol=SINGLE_MM)


def test_several_scans_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="it holds 2 scans"):
        read_cloud(write(tmp_path / "c.e57", scans=2))


def test_damaged_files_are_one_sentence_and_harm_no_one(tmp_path: Path) -> None:
    whole = np.frombuffer(write(tmp_path / "c.e57").read_bytes(), dtype=np.uint8)
    random = np.random.default_rng(7)
    answers = []
    for number in range(8):
        damaged = whole.copy()
        damaged[random.integers(0, len(whole), 20)] = random.integers(0, 256, 20)
        file = tmp_path / f"{number}.e57"
        file.write_bytes(damaged[: len(whole) // 2] if number == 0 else damaged)
        try:
            answers.append(str(read_cloud(file).points.shape))
        except InputError as error:
            answers.append(f"{error.code}: {error}")
    refused = [answer for answer in answers if answer.startswith("file.damaged: ")]
    assert len(refused) >= 4
    assert max(map(len, refused)) < 300
    assert "****" not in "".join(refused)
    assert set(answers) - set(refused) <= {str(POINTS.shape)}


def test_missing_library_is_named_with_the_command_that_installs_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(e57, "find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"pip install 'iriftrace\[e57\]'"):
        read_cloud(write(tmp_path / "c.e57"))


def test_a_corrected_cloud_is_refused(tmp_path: Path) -> None:
    """E57 cannot hold the columns of the correction; the name of the scan tells."""
    measured = np.ones(len(POINTS), dtype=bool)
    path = tmp_path / "corrected.e57"
    e57.write_e57(path, POINTS / 1e3, measured, {"correction_x": POINTS[:, 0]})
    with pytest.raises(InputError, match="is corrected already"):
        read_cloud(path)
    e57.write_e57(tmp_path / "plain.e57", POINTS / 1e3, measured, {"true_x": POINTS[:, 0]})
    assert len(read_cloud(tmp_path / "plain.e57").rows) == len(POINTS)
