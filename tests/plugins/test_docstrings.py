"""The XML and Python examples in the plugins' docstrings are typed in as they stand."""

import inspect
import re
from textwrap import dedent
from types import ModuleType
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from iriftrace.camera.distortion import ORDER
from iriftrace.camera.pose import look_at
from iriftrace.plugins import calibrated_camera, first_hit, gradient_path, iso_shell
from iriftrace.plugins import properties as camera_properties

MODULES = (iso_shell, first_hit, gradient_path, calibrated_camera)


def document(module: ModuleType, variant: str) -> str:
    text = inspect.getdoc(module.plugin_class(variant))
    assert text is not None
    return text


def example(text: str, language: str) -> str:
    found = re.search(rf"\.\. code-block:: {language}\n\n((?:    .*\n|\n)+)", text + "\n")
    assert found, f"no {language} example"
    return dedent(found[1]).strip()


def from_xml(module: ModuleType, variant: str) -> Any:
    code = example(document(module, variant), "xml")
    return mi.load_string(re.sub(r"^<(\w+)", r'<\1 version="3.0.0"', code))


def from_python(module: ModuleType, variant: str) -> Any:
    return eval(example(document(module, variant), "python"), {"mi": mi})


@pytest.mark.parametrize("module", MODULES, ids=lambda m: m.__name__.rpartition(".")[2])
def test_examples_run_and_make_the_plugin(module: ModuleType, variant: str) -> None:
    expected = module.plugin_class(variant)
    assert type(from_xml(module, variant)) is expected
    assert type(from_python(module, variant)) is expected


@pytest.mark.parametrize("module", MODULES, ids=lambda m: m.__name__.rpartition(".")[2])
def test_table_lists_every_parameter_that_is_read(module: ModuleType, variant: str) -> None:
    """And no other: what the constructor asks of its properties is in the table."""
    source = inspect.getsource(module.plugin_class(variant).__init__)
    if module is calibrated_camera:
        source += inspect.getsource(camera_properties)
    read = set(re.findall(r'props(?:, |\[|\.get\()"(\w+)"', source))
    if module is calibrated_camera:
        read.update(ORDER)
    listed = set(re.findall(r"^``(\w+)``  ", document(module, variant), flags=re.MULTILINE))
    assert listed == read


def test_examples_mean_the_same_in_both_languages(variant: str) -> None:
    xml, python = (load(iso_shell, variant) for load in (from_xml, from_python))
    assert (xml.ext_ior, xml.int_ior) == (python.ext_ior, python.int_ior) == (1.0002718, 1.0002553)
    xml, python = (load(first_hit, variant) for load in (from_xml, from_python))
    assert str(xml) == str(python)
    xml, python = (load(gradient_path, variant) for load in (from_xml, from_python))
    assert str(xml) == str(python)
    xml, python = (load(calibrated_camera, variant) for load in (from_xml, from_python))
    assert xml.description()["resolution"] == [1224, 1024]
    assert python.description()["resolution"] == [2448, 2048]
    assert xml.description()["focus_mm"] == [50.0, 250.0]
    # The dictionary's transform is in single precision.
    pose = look_at((150, -100, 120), (0, 0, 0))
    np.testing.assert_allclose(xml.description()["matrix"], pose, atol=1e-12)
    np.testing.assert_allclose(python.description()["matrix"], pose, atol=1e-6)


def test_package_example_runs(variant: str) -> None:
    """The lines of the package's docstring, but for the variant, which is set."""
    import iriftrace.plugins

    lines = re.findall(r"^>>> (.*)$", iriftrace.plugins.__doc__ or "", flags=re.MULTILINE)
    assert lines[-1] == "iriftrace.plugins.register()"
    for line in lines:
        if "set_variant" not in line:
            exec(line, {"iriftrace": iriftrace})
