"""Camera calibrations that OpenCV or a program like it wrote, as YAML, XML or JSON.

OpenCV knows lengths in pixels only: a focal length of 3650 px is that of a 10 mm lens before pixels
of 2.74 um as well as of any other with the same ratio. All rays are the same; only the size of a
pixel turns them into the focal length and the sensor's size that results state.
"""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from attrs import frozen

from iriftrace.camera.camera import Camera
from iriftrace.camera.distortion import Distortion
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError

LARGEST_PIXEL_MM = 0.5
"""No camera has such; a number of this size is one in micrometres."""

# Whatever their case: OpenCV 2.4 wrote Camera_Matrix, ROS 2 writes k.
_MATRIX = ("camera_matrix", "cameraMatrix", "K")
_DISTORTION = ("distortion_coefficients", "distCoeffs", "dist_coeffs", "D")
_WIDTH = ("image_width", "imageWidth", "width")
_HEIGHT = ("image_height", "imageHeight", "height")
_ROTATION = ("rvec", "rotation_vector", "R", "rotation", "rotation_matrix")
_TRANSLATION = ("tvec", "translation_vector", "T", "t", "translation")
_VIEWS = ("extrinsic_parameters",)
_OF_TWO = ("M1", "cameraMatrix1", "camera_matrix_1", "K1", "M2", "K2")
_FISHEYE = ("fisheye_model", "fisheye")
_PROJECTION = ("P", "projection_matrix")
_RADTAN = ("radtan", "radial-tangential", "radial_tangential", "radialtangential")
"""Names of k1, k2, p1, p2 in Kalibr and its like."""

_MODELS = ("plumb_bob", "rational_polynomial", "brown", "brown_conrady", "opencv", *_RADTAN)


@frozen(eq=False, kw_only=True)
class Calibration:
    """Camera as a calibration file describes it.

    Attributes
    ----------
    focal_px : (2,) float, px
        Focal length in pixel widths and heights.
    centre_px : (2,) float, px
        Principal point as OpenCV counts: the first pixel's centre is (0, 0).
    resolution : (2,) int
        Pixels across and down of the pictures that were calibrated with.
    distortion : Distortion
    matrix : (4, 4) array or None
        Camera to world, mm, where the file has one pose.
    views : int
        Poses of a calibration board in the file; more than one are no pose of the camera.
    """

    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    resolution: tuple[int, int]
    distortion: Distortion
    matrix: FloatArray | None
    views: int

    def camera(self, *, pixel_size_mm: float, **more: Any) -> Camera:
        """The calibrated camera.

        Parameters
        ----------
        pixel_size_mm : float, mm
            Width of a pixel. Its height follows from the two focal lengths, which belong to one
            lens.
        **more
            Focus interval and pose, as of :class:`iriftrace.camera.camera.Camera`.
        """
        if not 0 < pixel_size_mm < LARGEST_PIXEL_MM:
            raise InputError(
                f"Pixel size is {pixel_size_mm} mm (--pixel-size); give the width of a pixel, such "
                "as 0.00274 mm."
            )
        across, down = self.focal_px
        width, height = self.resolution
        return Camera(
            focal_length_mm=across * pixel_size_mm,
            sensor_mm=(width * pixel_size_mm, height * pixel_size_mm * across / down),
            resolution=self.resolution,
            principal_point_px=(self.centre_px[0] + 0.5, self.centre_px[1] + 0.5),
            distortion=self.distortion,
            **more,
        )


def read_calibration(path: str | Path, *, length_mm: float = 1.0) -> Calibration:
    """Read a camera calibration that OpenCV's FileStorage or a program like it wrote.

    Read are ``camera_matrix``, ``distortion_coefficients`` (4, 5 or 8 in OpenCV's order; more if
    the others are 0), ``image_width``, ``image_height``, and, where they are, ``rvec`` and ``tvec``
    (world to camera) or one row of ``extrinsic_parameters``; matrices as OpenCV writes them or as
    plain lists.

    Parameters
    ----------
    path : path
        YAML, XML or JSON.
    length_mm : float
        Length unit of the translation, mm.

    Raises
    ------
    InputError
        The file is missing, cannot be read, lacks one of these, or has another lens model.
    """
    file = _File(Path(path), _content(Path(path)))
    file.refuse_other_models()
    file.refuse_two_cameras()
    matrix = file.array(_MATRIX, (9,)).reshape(3, 3)
    if matrix[0, 0] <= 0 or matrix[1, 1] <= 0 or not np.allclose(matrix[2], (0, 0, 1)):
        raise file.wrong(
            f"{matrix.tolist()} is no camera matrix; it is [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]"
        )
    if abs(matrix[0, 1]) > 1e-9 * matrix[0, 0] or matrix[1, 0] != 0:
        raise file.wrong(
            f"the camera matrix has the skew {matrix[0, 1]:g}, which is not modelled; calibrate "
            "without it"
        )
    return Calibration(
        focal_px=(float(matrix[0, 0]), float(matrix[1, 1])),
        centre_px=(float(matrix[0, 2]), float(matrix[1, 2])),
        resolution=(file.whole(_WIDTH), file.whole(_HEIGHT)),
        distortion=file.distortion(),
        matrix=file.pose(length_mm),
        views=file.views(),
    )


LARGEST_BYTES = 4_000_000
"""Size of a calibration with the poses of ten thousand boards, which YAML reads in ten seconds."""


class _MatrixLoader(yaml.SafeLoader):  # type: ignore[misc, unused-ignore]
    """Plain YAML, in which OpenCV's tagged matrices are mappings like any other.

    Aliases are refused: OpenCV writes none, and ten lines of them stand for billions of values.
    """

    def compose_node(self, parent: Any, index: Any) -> Any:
        """The next value of the file."""
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("it has aliases, which no calibration needs")
        return super().compose_node(parent, index)


_MatrixLoader.add_multi_constructor(
    "tag:yaml.org,2002:opencv-",
    lambda loader, _suffix, node: loader.construct_mapping(node, deep=True),
)


def _content(path: Path) -> Mapping[str, Any]:
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise InputError(
                f"The calibration {path} has {path.stat().st_size:,} bytes, more than any camera "
                f"needs ({LARGEST_BYTES:,}); give the file that OpenCV's FileStorage wrote."
            )
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"cannot read the calibration {path}: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise InputError(
            f"The calibration {path} is no text; give the YAML or JSON that OpenCV's FileStorage "
            "wrote."
        ) from error
    try:
        if text.lstrip().startswith("<"):
            content: Any = _xml_values(text)
        elif text.lstrip().startswith("{"):
            content = json.loads(text)
        else:
            content = _yaml_values(text)
    except (ValueError, RecursionError, yaml.YAMLError, ElementTree.ParseError) as error:
        raise InputError(
            f"{path} is neither YAML, XML nor JSON of a calibration "
            f"({' '.join(str(error).split())}); give the file that OpenCV's FileStorage wrote."
        ) from error
    if not isinstance(content, Mapping):
        raise InputError(f"{path} holds no named values; give a camera calibration of OpenCV.")
    return content


_NO_BLANK = re.compile(r"^(\s*[A-Za-z_]\w*):(?=\S)", re.MULTILINE)


def _yaml_values(text: str) -> Any:
    """The one document of a YAML file; `rostopic echo` ends it with a line of its own."""
    # OpenCV's first line, "%YAML:1.0", is not YAML, and neither is key:value.
    first, _, rest = text.partition("\n")
    plain = _NO_BLANK.sub(r"\1: ", rest if first.startswith("%YAML") else text)
    documents = [one for one in yaml.load_all(plain, Loader=_MatrixLoader) if one is not None]
    if len(documents) > 1:
        raise ValueError(f"it has {len(documents)} documents instead of one")
    return documents[0] if documents else None


def _xml_values(text: str) -> dict[str, Any]:
    """Named values of OpenCV's XML, matrices as mappings with ``data``."""
    if "<!ENTITY" in text:
        raise ValueError("it has entities, which no calibration needs")
    root = ElementTree.fromstring(text)
    if root.tag != "opencv_storage":
        raise ValueError(f"its XML is <{root.tag}> and not OpenCV's <opencv_storage>")
    return {
        entry.tag: {"data": (entry.findtext("data") or "").split()}
        if entry.find("data") is not None
        else (entry.text or "").strip().strip('"')
        for entry in root
    }


@frozen(eq=False)
class _File:
    """The named values of a calibration file, which are checked when they are asked for."""

    path: Path
    content: Mapping[str, Any]

    def wrong(self, fault: str) -> InputError:
        return InputError(f"The calibration {self.path}: {fault}.")

    def named(self, names: tuple[str, ...]) -> Any:
        folded = {str(name).casefold(): value for name, value in self.content.items()}
        exact = (self.content[name] for name in names if name in self.content)
        any_case = (folded[name.casefold()] for name in names if name.casefold() in folded)
        return next(chain(exact, any_case), None)

    def array(self, names: tuple[str, ...], counts: tuple[int, ...] = ()) -> FloatArray:
        """Numbers of a matrix, flat; how many there may be (any when empty)."""
        value = self.named(names)
        if value is None:
            raise self.wrong(f"{names[0]} is missing, without which there are no rays; add it")
        if isinstance(value, Mapping):
            value = value.get("data")
        try:
            numbers = np.asarray(value, dtype=np.float64).ravel()
        except (TypeError, ValueError):
            numbers = np.array((np.nan,))
        if not np.isfinite(numbers).all():
            raise self.wrong(f"{names[0]} has entries that are no finite numbers; write it again")
        if counts and len(numbers) not in counts:
            wanted = " or ".join(map(str, counts))
            raise self.wrong(f"{names[0]} has {len(numbers)} numbers instead of {wanted}")
        return numbers

    def whole(self, names: tuple[str, ...]) -> int:
        value = self.array(names, (1,))[0]
        if value % 1 or value < 1:
            raise self.wrong(f"{names[0]} is {value:g}, but pixels are whole numbers from 1 on")
        return int(value)

    def distortion(self) -> Distortion:
        if self.named(_DISTORTION) is None:
            raise self.wrong(
                f"{_DISTORTION[0]} is missing; for a lens without distortion write "
                f"{_DISTORTION[0]}: [0, 0, 0, 0]"
            )
        values = self.array(_DISTORTION)
        if self.model() in _RADTAN and len(values) != 4:
            raise self.wrong(
                f"the lens model {self.model()!r} has four coefficients, k1, k2, p1, p2, but the "
                f"file has {len(values)}; name the model of these"
            )
        if values[8:].any():
            raise self.wrong(
                f"{len(values)} distortion coefficients with thin prism or tilt terms are given, "
                "which are not modelled; calibrate with k1 to k6, p1 and p2 only"
            )
        try:
            return Distortion.of_sequence(values[:8])
        except InputError as error:
            raise self.wrong(str(error).rstrip(".")) from error

    def model(self) -> str:
        """Lens model that the file names, in lower case; "" for none."""
        return str(self.named(("distortion_model", "camera_model")) or "").lower()

    def refuse_other_models(self) -> None:
        model = self.model()
        known = (*_MODELS, "pinhole")
        if str(self.named(_FISHEYE) or 0).lower() not in ("0", "false"):
            raise self.wrong(
                "it is of OpenCV's fisheye model, which is not modelled; calibrate with the one of "
                "Brown and Conrady"
            )
        if model and model not in known:
            raise self.wrong(
                f"the lens model {model!r} is not the one of Brown and Conrady ({', '.join(known)})"
                "; calibrate with that"
            )

    def refuse_two_cameras(self) -> None:
        two = [name for name in _OF_TWO if name in self.content]
        if two and self.named(_MATRIX) is None:
            raise self.wrong(
                f"it is of two cameras ({', '.join(two)}); write a file for each, with "
                f"{_MATRIX[0]}, {_DISTORTION[0]}, {_WIDTH[0]} and {_HEIGHT[0]}, and {_ROTATION[0]} "
                f"and {_TRANSLATION[0]} from the part's frame to that camera's"
            )

    def views(self) -> int:
        return 0 if self.named(_VIEWS) is None else len(self.array(_VIEWS)) // 6

    def pose(self, length_mm: float) -> FloatArray | None:
        """Camera to world, (4, 4) array, mm."""
        from scipy.spatial.transform import Rotation

        turn, shift = self.named(_ROTATION), self.named(_TRANSLATION)
        if shift is None and self.named(_PROJECTION) is not None:
            # The R of a CameraInfo message of ROS is its rectification.
            turn = None
        if (turn is None) != (shift is None):
            raise self.wrong("it has only one of rvec and tvec, which is no pose; give both")
        if turn is not None:
            rotation, translation = self.array(_ROTATION, (3, 9)), self.array(_TRANSLATION, (3,))
        elif self.views() == 1:
            row = self.array(_VIEWS, (6,))
            rotation, translation = row[:3], row[3:]
        else:
            return None
        if len(rotation) == 3 and np.linalg.norm(rotation) > 2 * np.pi:
            raise self.wrong(
                f"its rotation vector {rotation.tolist()} turns by {np.linalg.norm(rotation):.4g} "
                "rad, more than a whole turn, so it is in degrees or no rotation vector; give "
                "radians (axis times angle, as of OpenCV's Rodrigues), or the rotation matrix"
            )
        to_camera = (
            Rotation.from_rotvec(rotation).as_matrix()
            if len(rotation) == 3
            else rotation.reshape(3, 3)
        )
        if not np.allclose(to_camera @ to_camera.T, np.eye(3), atol=1e-6) or (
            np.linalg.det(to_camera) < 0
        ):
            raise self.wrong(
                "its rotation does not turn, but stretches or mirrors; give a rotation"
            )
        matrix = np.eye(4)
        matrix[:3, :3] = to_camera.T
        matrix[:3, 3] = -to_camera.T @ translation * length_mm
        return matrix
