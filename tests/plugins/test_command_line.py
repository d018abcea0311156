"""Mitsuba's command line with the plugins, and the file that a film writes."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from iriftrace.core.errors import InputError
from iriftrace.image.aov_image import SCHEMA
from iriftrace.io.exr import read_exr
from iriftrace.plugins.__main__ import main
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.render import render_scene

pytestmark = pytest.mark.usefixtures("variant")


@pytest.fixture
def xml(tmp_path: Path) -> Path:
    """The slab's scene in a folder of its own."""
    return Path(shutil.copytree(folder_of("slab"), tmp_path / "slab")) / "scene.xml"


def test_the_film_of_a_scene_holds_the_channels_of_a_rendering(xml: Path, variant: str) -> None:
    """In a process of its own: the workers of the tests have one thread, too few for the writer."""
    command = [sys.executable, "-m", "iriftrace.plugins", str(xml), "-D", "scale=0.05", "-t", "2"]
    subprocess.run([*command, "-m", variant], check=True)
    image = read_exr(xml.with_suffix(".exr"))
    expected = render_scene(load_scene(xml, {"scale": 0.05})).image
    assert (image.status == 0).any()
    assert image.channels.keys() == expected.channels.keys()
    for name, pixels in expected.channels.items():
        np.testing.assert_array_equal(image.channels[name], pixels, err_msg=name)
    assert image.header == {"schema": SCHEMA}
    with pytest.raises(InputError, match="header has no camera: a film of Mitsuba wrote it"):
        _ = image.camera


def test_other_pictures_have_no_channels(tmp_path: Path) -> None:
    picture = {"RGB": np.ones((4, 5, 3), dtype=np.float32)}
    OpenEXR.File({"type": OpenEXR.scanlineimage}, picture).write(str(tmp_path / "light.exr"))
    with pytest.raises(InputError, match="did not write it"):
        read_exr(tmp_path / "light.exr")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-D", "scal=0.05"], "unused parameters"),
        (["-D", "scale"], "'scale' defines no parameter"),
        (["-D", "scale=0.05", "-s", "1"], "There is no sensor 1"),
        (["-D", "scale=0.05", "-t", "1"], "Mitsuba hangs"),
        (["-m", "scalar_rgb"], "choose llvm_ad_mono"),
        (["-D", "scale=-1"], "scale"),
        (["other.xml", "-o", "picture.exr"], "leave it out"),
    ],
)
def test_what_is_wrong_ends_with_status_2(
    xml: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    with pytest.raises(SystemExit) as ended:
        main([str(xml), *arguments])
    assert ended.value.code == 2
    written = capsys.readouterr().err
    assert message in written
    assert "Traceback" not in written
    assert list(xml.parent.glob("*.exr")) == []
