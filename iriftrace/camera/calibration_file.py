"""Text of calibration files: YAML, XML or JSON to named values, and these by their many names."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping
from contextlib import suppress
from itertools import chain, pairwise
from pathlib import Path

import numpy as np
import yaml
from attrs import frozen

from iriftrace.camera.calibration_programs import (
    colmap_values,
    realsense_values,
    refuse_other_programs,
)
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.files import text_in
from iriftrace.core.plain import TwiceError, once
from iriftrace.core.units import LENGTH_UNITS, stated_length_unit

MISSING = -9999.0
"""Number that programs write for a value that is missing."""

LARGEST_BYTES = 4_000_000
"""Size of a calibration with the poses of ten thousand boards, which YAML reads in ten seconds."""

LARGEST_VALUES = 4_000_000
"""Numbers in a file, with its aliases written out; each takes one byte at least."""


_LENGTH_UNIT = re.compile(
    "(?:length|translation|t|tvec|trans|pose|extrinsics?|baseline|world|position|distance)?"
    "units?(?:t|tvec)?"
)
_OF_PIXELS = ("", "px", "pixel", "pixels")


class _MatrixLoader(yaml.SafeLoader):  # type: ignore[misc, unused-ignore]
    """Plain YAML, in which OpenCV's tagged matrices are mappings like any other.

    PyYAML writes lists that occur twice as aliases. Ten lines of aliases can stand for billions of
    values, so the values are counted as if each alias were written out.
    """

    def __init__(self, stream: str) -> None:
        super().__init__(stream)
        self._values: dict[yaml.Node, int] = {}

    def compose_node(self, parent: yaml.Node | None, index: object) -> yaml.Node:
        """The next value of the file."""
        alias = self.check_event(yaml.AliasEvent)
        node = super().compose_node(parent, index)
        if alias and node not in self._values:
            raise yaml.YAMLError("it has an alias to a value that contains the alias")
        if not alias:
            self._values[node] = 1 + sum(self._values[child] for child in _children(node))
        if self._values[node] > LARGEST_VALUES:
            raise yaml.YAMLError(f"its aliases stand for more than {LARGEST_VALUES:,} values")
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[object, object]:
        """A mapping, whose names differ."""
        names = (key for key, _ in node.value if isinstance(key, yaml.ScalarNode))
        once((key.value, None) for key in names)
        values: dict[object, object] = super().construct_mapping(node, deep)
        return values


def _children(node: yaml.Node) -> Iterable[yaml.Node]:
    """Nodes that a sequence or a mapping holds."""
    if isinstance(node, yaml.SequenceNode):
        return list(node.value)
    if isinstance(node, yaml.MappingNode):
        return [child for pair in node.value for child in pair]
    return ()


_MatrixLoader.add_multi_constructor(
    "tag:yaml.org,2002:opencv-",
    lambda loader, _suffix, node: loader.construct_mapping(node, deep=True),
)
# Words to YAML 1.1, which wants a point and a sign, as in 1.0e+3.
_MatrixLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?\d+(?:\.\d*)?[eE][-+]?\d+$"), "-+0123456789"
)


def calibration_content(path: Path) -> Mapping[str, object]:
    """Named values of a calibration file.

    Matrices are flat or nested lists, or mappings with these under ``data``. An InputError if the
    file cannot be read or holds no named values.
    """
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise InputError(
                f"The calibration {path} has {path.stat().st_size:,} bytes, more than any camera "
                f"needs ({LARGEST_BYTES:,}); give the file that OpenCV's FileStorage wrote."
            )
        text = text_in(path)
    except OSError as error:
        raise InputError(f"cannot read the calibration {path}: {error.strerror}.") from error
    if "\0" in text:
        raise InputError(
            f"The calibration {path} is a binary file; give YAML, XML or JSON with OpenCV's names "
            "(unpacked, if it is packed)."
        )
    refuse_other_programs(path, text)
    colmap = colmap_values(path, text)
    if colmap is not None:
        return colmap
    try:
        if text.lstrip().startswith("<"):
            content: object = _xml_values(text)
        elif text.lstrip().startswith("{"):
            content = json.loads(text, object_pairs_hook=once)
        else:
            content = _yaml_values(text)
    except TwiceError as error:
        raise InputError(
            f"The calibration {path} has {error} twice; leave out the one that is not meant."
        ) from error
    except (ValueError, RecursionError, yaml.YAMLError, ElementTree.ParseError) as error:
        raise InputError(
            f"{path} is neither YAML, XML nor JSON of a calibration "
            f"({' '.join(str(error).split())}); give the file that OpenCV's FileStorage wrote."
        ) from error
    content = _with_named_cameras(content)
    if not isinstance(content, Mapping):
        raise InputError(f"{path} holds no named values; give a camera calibration of OpenCV.")
    values = list(content.values())
    # A file may have one name for the whole, such as `stereo`; a matrix is a mapping with `data`.
    whole = len(values) == 1 and isinstance(values[0], Mapping) and "data" not in values[0]
    named = realsense_values(values[0] if whole else content)
    remarks = (line for line in text.splitlines() if line.lstrip().startswith("#"))
    unit = next(filter(None, map(stated_length_unit, remarks)), "")
    stated = any(is_length_unit(str(name)) for name in named)
    return {**named, "length_unit": unit} if unit and not stated else named


def _with_named_cameras(content: object) -> object:
    """Values in which a list of cameras is cam0, cam1 ..., or a single one as if it were alone."""
    values: object = {"cameras": content} if isinstance(content, list) else content
    if not isinstance(values, Mapping) or not isinstance(values.get("cameras"), list):
        return content
    rest = {name: value for name, value in values.items() if name != "cameras"}
    cameras = values["cameras"]
    if not all(isinstance(camera, Mapping) for camera in cameras):
        return content
    named = {f"cam{number}": camera for number, camera in enumerate(cameras)}
    return {**rest, **(cameras[0] if len(cameras) == 1 else named)}


_NO_BLANK = re.compile(r"^(\s*[A-Za-z_]\w*):(?=\S)", re.MULTILINE)


def _yaml_values(text: str) -> object:
    """The one document of a YAML file; `rostopic echo` ends it with a line of its own."""
    # OpenCV's first line, "%YAML:1.0", is not YAML, and neither is key:value.
    first, _, rest = text.partition("\n")
    plain = _NO_BLANK.sub(r"\1: ", rest if first.startswith("%YAML") else text)
    documents = [one for one in yaml.load_all(plain, Loader=_MatrixLoader) if one is not None]
    if len(documents) > 1:
        raise ValueError(f"it has {len(documents)} documents instead of one")
    return documents[0] if documents else None


def _xml_values(text: str) -> dict[str, object]:
    """Named values of OpenCV's XML."""
    if "<!ENTITY" in text:
        raise ValueError("it has entities, which no calibration needs")
    root = ElementTree.fromstring(text)
    if root.tag != "opencv_storage":
        raise ValueError(f"its XML is <{root.tag}> and not OpenCV's <opencv_storage>")
    return once((entry.tag, _xml_value(entry)) for entry in root)


def _xml_value(entry: ElementTree.Element) -> object:
    """A mapping, a sequence (its entries have the tag ``_``), or words; a number or one word."""
    if len(entry) and all(child.tag == "_" for child in entry):
        return [_xml_value(child) for child in entry]
    if len(entry):
        return once((child.tag, _xml_value(child)) for child in entry)
    text = (entry.text or "").strip()
    words = text.split()
    with suppress(ValueError):
        return float(text)
    return text.strip('"') if text.startswith('"') or len(words) < 2 else words


def folded(name: str) -> str:
    """A name without case and punctuation: camera_matrix and cameraMatrix are the same."""
    return "".join(letter for letter in name.casefold() if letter.isalnum())


def is_length_unit(name: str) -> bool:
    """True for a name of the unit of lengths."""
    return bool(_LENGTH_UNIT.fullmatch(folded(name)))


def _numbers(value: object) -> FloatArray:
    """Numbers of a matrix, flat; one NaN for what has others than numbers."""
    if isinstance(value, Mapping):
        value = value.get("data")
    try:
        return np.asarray(value, dtype=np.float64).ravel()
    except (TypeError, ValueError):
        return np.array((np.nan,))


@frozen(eq=False)
class CalibrationValues:
    """Named values of one camera, checked when they are read."""

    path: Path  # for messages
    content: Mapping[str, object]
    camera: str = ""  # which of several cameras of the file, for messages

    @property
    def called(self) -> str:
        """File and camera, for messages."""
        return f"{self.path}, {self.camera}" if self.camera else str(self.path)

    @property
    def length_unit(self) -> str | None:
        """Unit of lengths that the file states, as `length_factor` takes it."""
        units = (value for name, value in self.content.items() if is_length_unit(str(name)))
        lengths = (str(unit) for unit in units if str(unit or "").casefold() not in _OF_PIXELS)
        stated = next(lengths, None)
        if stated is None:
            return None
        if stated.casefold() not in LENGTH_UNITS:
            raise self.wrong(
                f"its unit {stated!r} is not known here; give the unit of translations "
                "(--calibration-length-unit)"
            )
        return LENGTH_UNITS[stated.casefold()]

    def wrong(self, fault: str) -> InputError:
        """The error for a fault of this file."""
        return InputError(f"The calibration {self.called}: {fault}.")

    def named(self, names: Iterable[str]) -> object:
        """Value under the first of the names that the file has, in any case; None without one."""
        name = self.spelling(names)
        return None if name is None else self.content[name]

    def spelling(self, names: Iterable[str]) -> str | None:
        """The first of the names that the file has, as it writes it."""
        names = tuple(names)
        any_case = {folded(str(name)): name for name in self.content}
        # imageSize is image_size before size is another size, but k is K only without M.
        words = (name for name in names if name in self.content or len(name) > 1)
        in_order = chain(words, names)
        found = (name if name in self.content else any_case.get(folded(name)) for name in in_order)
        return next((name for name in found if name is not None), None)

    def refuse_different(self, names: Iterable[str]) -> None:
        """Refuse a file with several of the names that has as many but other numbers for each."""
        known = set(map(folded, names))
        there = [name for name in self.content if folded(str(name)) in known]
        arrays = [(name, _numbers(self.content[name])) for name in there]
        for (first, one), (second, two) in pairwise(arrays):
            if len(one) == len(two) and not np.array_equal(one, two, equal_nan=True):
                raise self.wrong(
                    f"{first} and {second} are different; leave out the one that is not meant"
                )

    def array(self, names: tuple[str, ...], counts: tuple[int, ...] = ()) -> FloatArray:
        """Numbers of a matrix, flat; how many there may be (any when empty)."""
        name = self.spelling(names)
        value = None if name is None else self.content[name]
        if value is None:
            raise self.wrong(f"{names[0]} is missing, without which there are no rays; add it")
        if isinstance(value, Mapping) and "data" not in value:
            listed = ", ".join(map(str, value))
            raise self.wrong(f"{name} has the entries {listed} instead of numbers alone")
        numbers = _numbers(value)
        if not np.isfinite(numbers).all() or (numbers == MISSING).any():
            raise self.wrong(
                f"{name} has entries that are not finite numbers, or {MISSING:g}; write it again"
            )
        if counts and len(numbers) not in counts:
            allowed = " or ".join(map(str, counts))
            raise self.wrong(f"{name} has {len(numbers)} numbers instead of {allowed}")
        return numbers

    def whole(self, names: tuple[str, ...]) -> int:
        """A number of pixels."""
        value = self.array(names, (1,))[0]
        if value % 1 or value < 1:
            raise self.wrong(f"{names[0]} is {value:g}, but pixels are whole numbers from 1 on")
        return int(value)
