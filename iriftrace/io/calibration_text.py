"""Text of calibration files: YAML, XML or JSON to named values."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

import yaml

from iriftrace.core.errors import InputError
from iriftrace.core.files import text_in
from iriftrace.core.plain import TwiceError, once
from iriftrace.io.refusals import check_exists, damaged

LARGEST_BYTES = 4_000_000
"""Size of a calibration with the poses of ten thousand boards, which YAML reads in ten seconds."""

LARGEST_VALUES = 4_000_000
"""Numbers in a file, with its aliases written out; each takes one byte at least."""


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


def calibration_text(path: Path) -> str:
    """Text of a calibration file; InputError if it cannot be read, is too large or binary."""
    check_exists(path, "give a camera calibration")
    if path.stat().st_size > LARGEST_BYTES:
        raise InputError(
            f"The calibration {path} has {path.stat().st_size:,} bytes, more than any camera needs "
            f"({LARGEST_BYTES:,}); give the file that OpenCV's FileStorage wrote.",
            code="calibration.too_large",
        )
    text = text_in(path)
    if "\0" in text:
        raise damaged(path, "it is a binary file", "give YAML, XML or JSON, unpacked")
    return text


def named_values(path: Path, text: str) -> Mapping[str, object]:
    """Named values of a calibration's text: numbers, words, lists, and mappings of these.

    OpenCV's matrices are mappings with the numbers, flat, under ``data``. An InputError if it is
    none of YAML, XML and JSON, has a name twice, or holds no named values.
    """
    try:
        if text.lstrip().startswith("<"):
            content: object = _xml_values(text)
        elif text.lstrip().startswith("{"):
            content = json.loads(text, object_pairs_hook=once)
        else:
            content = _yaml_values(text)
    except TwiceError as error:
        raise InputError(
            f"The calibration {path} has {error} twice; leave out the one that is not meant.",
            code="calibration.twice",
        ) from error
    except (ValueError, RecursionError, yaml.YAMLError, ElementTree.ParseError) as error:
        raise damaged(
            path, " ".join(str(error).split()), "give YAML, XML or JSON of a calibration"
        ) from error
    if not isinstance(content, Mapping):
        raise damaged(path, "it holds no named values", "give a camera calibration of OpenCV")
    return {str(name): value for name, value in content.items()}


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
