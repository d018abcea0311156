"""Code beside a scene or in the working folder is refused, as Mitsuba would run it."""

import shutil
from pathlib import Path

import pytest

from iriftrace.core.errors import InputError
from iriftrace.core.runtime import variant as runtime
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene


def library_in(folder: Path) -> None:
    (folder / "plugins").mkdir()
    (folder / "plugins" / "perspective.so").write_bytes(b"anything")


def test_a_working_folder_with_compiled_plugins_is_refused(
    variant: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert runtime.ensure(variant) == variant
    library_in(tmp_path)
    with pytest.raises(InputError, match=r"perspective\.so.*another folder"):
        runtime.ensure(variant)


@pytest.mark.usefixtures("variant")
def test_a_scene_with_compiled_plugins_beside_it_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "scene"
    shutil.copytree(folder_of("slab"), folder)
    assert load_scene(folder / "scene.xml").compiled.engine == "shells"
    library_in(folder)
    with pytest.raises(InputError, match=r"perspective\.so"):
        load_scene(folder / "scene.xml")
