"""Text of calibrations: YAML, XML and JSON in their variants, damaged, too large or hostile."""

from pathlib import Path

import pytest
import yaml

from iriftrace.core.errors import InputError
from iriftrace.io.calibration import read_calibration
from validation.inputs.calibration_files import COEFFICIENTS, PLAIN, plain


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("{", "file.damaged"),
        ("a: [1, 2", "file.damaged"),
        ("a: !!python/object/apply:os.getcwd []", "file.damaged"),
        ("just words", "file.damaged"),
        ("<?xml version='1.0'?><opencv_storage/>", "file.dialect"),
        ("<?xml version='1.0'?><calibration><f>3650</f></calibration>", "file.damaged"),
        ("<?xml version='1.0'?><opencv_storage>", "file.damaged"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><opencv_storage/>", "file.damaged"),
        ("a: 1\n---\na: 2\n", "file.damaged"),
        ("", "file.damaged"),
        # As OpenCV's stereo example writes it.
        ("M1: [1]\nD1: [0]\nM2: [1]\nD2: [0]", "calibration.two_cameras"),
        (" " * 5_000_000, "calibration.too_large"),
    ],
    ids=lambda value: value[:20],
)
def test_files_that_are_something_else(tmp_path: Path, text: str, code: str) -> None:
    (tmp_path / "camera.yaml").write_text(text)
    with pytest.raises(InputError) as error:
        read_calibration(tmp_path / "camera.yaml")
    assert error.value.code == code


def test_a_file_that_is_not_there_and_a_binary_one(tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        read_calibration(tmp_path / "gone.yaml")
    assert error.value.code == "file.missing"
    (tmp_path / "camera.yaml").write_bytes(b"\x80\x00")
    with pytest.raises(InputError, match=r"it is a binary file.; give YAML"):
        read_calibration(tmp_path / "camera.yaml")


def test_aliases_are_read_unless_they_stand_for_too_much(tmp_path: Path) -> None:
    """PyYAML writes lists that occur twice as aliases; ten lines may be ten billion numbers."""
    values = PLAIN | {"also": PLAIN["distortion_coefficients"]}
    (tmp_path / "twice.yaml").write_text(text := yaml.safe_dump(values))
    assert "*id001" in text
    found = read_calibration(tmp_path / "twice.yaml")
    assert found.distortion.coefficients == (*COEFFICIENTS, 0, 0, 0)
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, 10)]
    for text, fault in (
        ("\n".join([*lines, "camera_matrix: *a9"]), "aliases stand for more than 4,000,000"),
        ("camera_matrix: &a [1, *a]", "alias to a value that contains the alias"),
    ):
        (tmp_path / "bomb.yaml").write_text(text)
        with pytest.raises(InputError, match=fault):
            read_calibration(tmp_path / "bomb.yaml")


TWICE = {
    "yaml": "camera: {K: [1], K: [2]}",
    "json": '{"a": {"K": [1], "K": [2]}}',
    "xml": "<opencv_storage><K>1</K><K>2</K></opencv_storage>",
}


@pytest.mark.parametrize("ending", TWICE)
def test_a_name_that_is_there_twice_is_refused(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"a.{ending}"
    path.write_text(TWICE[ending])
    with pytest.raises(InputError, match="has K twice; leave out the one that is not meant"):
        read_calibration(path)


@pytest.mark.parametrize("ending", ["yaml", "xml"])
def test_numbers_in_any_notation(tmp_path: Path, ending: str) -> None:
    matrix = "3.65e3 0 1210 0 365e1 1.03E3 0 0 1".split()
    if ending == "yaml":
        text = f"camera_matrix: [{', '.join(matrix)}]\ndistortion_coefficients: [-8e-2, 1, 0, 0, 0]"
        text += "\nimage_width: 2448\nimage_height: 2048\n"
    else:
        text = f"<camera_matrix>{' '.join(matrix)}</camera_matrix><image_width>2448</image_width>"
        text += "<distortion_coefficients>-8e-2 1 0 0 0</distortion_coefficients>"
        text = f"<opencv_storage>{text}<image_height>2048</image_height></opencv_storage>"
    path = tmp_path / f"a.{ending}"
    path.write_text(text)
    found = read_calibration(path)
    assert (found.focal_px, found.centre_px) == ((3650.0, 3650.0), (1210.0, 1030.0))
    assert found.distortion.coefficients[:2] == (-0.08, 1.0)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_encodings_of_windows(tmp_path: Path, encoding: str) -> None:
    text = "# Pr\u00fcfstand\r\n" + plain(tmp_path / "a.json").read_text()
    (tmp_path / "a.yaml").write_bytes(text.encode(encoding))
    assert read_calibration(tmp_path / "a.yaml").focal_px == (3653.8, 3657.25)
