"""R and T next to what OpenCV computed from them: the same motion, or refused."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from iriftrace.camera.stereo import read_stereo_calibration
from iriftrace.core.errors import InputError
from validation.inputs import stereo_files as rig

INVERSE = {"R": rig.ROTATION.T, "T": -rig.ROTATION.T @ rig.TRANSLATION}
(M1, M2), (D1, D2) = rig.MATRICES, rig.COEFFICIENTS
RECTIFIED = dict(
    zip(
        ("R1", "R2", "P1", "P2"),
        cv2.stereoRectify(M1, D1, M2, D2, rig.SIZE, rig.ROTATION, rig.TRANSLATION[:, None])[:4],
        strict=True,
    )
)
CROSS = np.cross(np.eye(3), rig.TRANSLATION)  # rows e_i x T, [T]x
ESSENTIAL = {"E": CROSS @ rig.ROTATION}


@pytest.mark.parametrize("others", [RECTIFIED, ESSENTIAL, {"E": -2.0 * ESSENTIAL["E"]}])
def test_an_inverse_motion_is_refused(tmp_path: Path, others: dict[str, np.ndarray]) -> None:
    found = read_stereo_calibration(rig.opencv(tmp_path / "a.yaml", **others))
    assert_allclose(found.translation_mm, rig.TRANSLATION)
    path = rig.opencv(tmp_path / "b.yaml", **others, **INVERSE)
    with pytest.raises(InputError, match=r"R and T contradict its .* lead from camera 2 to camera"):
        read_stereo_calibration(path)


@pytest.mark.parametrize(
    "changes", [{"R": rig.ROTATION.T}, {"T": -rig.ROTATION.T @ rig.TRANSLATION}]
)
def test_another_motion_is_refused(tmp_path: Path, changes: dict[str, np.ndarray]) -> None:
    """A transposed R; the place of camera 2 in place of T."""
    path = rig.opencv(tmp_path / "a.yaml", **RECTIFIED, **changes)
    with pytest.raises(InputError, match="contradict its R1, R2, P1 and P2; export"):
        read_stereo_calibration(path)


@pytest.mark.parametrize("within", [False, True])
def test_another_baseline_is_refused(tmp_path: Path, within: bool) -> None:
    """T in centimetres is 10 times shorter than the baseline; one of no unit may be in metres."""
    length = float(np.linalg.norm(rig.TRANSLATION))

    def found(**entries: float) -> float:
        path = rig.opencv(tmp_path / "a.yaml")
        text = yaml.safe_dump({"extrinsics": entries} if within else entries)
        path.write_text(f"{path.read_text()}\n{text}")
        return read_stereo_calibration(path).baseline_mm

    for right in ({"baseline_mm": length}, {"baseline_m": 1e-3 * length}, {"Baseline": -length}):
        assert found(**right) == pytest.approx(length)
    assert found(baseline=1e-3 * 1.01 * length, rms=0.3) == pytest.approx(length)
    for wrong in ({"baseline_mm": 10.0 * length}, {"baseline": 1.05 * length}):
        with pytest.raises(InputError, match=rf"T is {length:.5g} mm long, but its baseline"):
            found(**wrong)


def test_projections_without_a_baseline_contradict_nothing(tmp_path: Path) -> None:
    """As those of cameras that were calibrated one by one, before their motion was found."""
    alone = RECTIFIED | {"P2": RECTIFIED["P1"]}
    found = read_stereo_calibration(rig.opencv(tmp_path / "a.yaml", **alone))
    assert_allclose(found.translation_mm, rig.TRANSLATION)
