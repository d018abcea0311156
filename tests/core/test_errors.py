"""Warnings point to the line of the user's program, however deep in the package they arise."""

from pathlib import Path

import pytest
import trimesh

from iriftrace.core.errors import IriftraceWarning
from iriftrace.io.clouds import read_cloud
from iriftrace.part.part import part_of_mesh
from iriftrace.tracing.hot_air import HotAir
from iriftrace.tracing.scene import Scene
from validation.inputs.cameras import camera_at
from validation.inputs.shell_fields import sphere_field


def test_a_function_of_a_function_warns_here(tmp_path: Path) -> None:
    cloud = tmp_path / "cloud.xyz"
    cloud.write_text("0 0 0\n1.2345 2 3\n4 5 6\n")
    with pytest.warns(IriftraceWarning, match="not measured|did not measure") as caught:
        read_cloud(cloud)
    assert {each.filename for each in caught} == {__file__}


@pytest.mark.usefixtures("variant")
def test_a_cached_property_warns_here() -> None:
    mesh = trimesh.creation.box((2.0, 2.0, 2.0))
    part = part_of_mesh(mesh.vertices, mesh.faces, name="box")
    camera = camera_at((0.0, 0.0, 100.0), (0.0, 0.0, 0.0))
    scene = Scene(part, HotAir(sphere_field(12)), camera)
    with pytest.warns(IriftraceWarning, match="no cavity") as caught:
        assert not scene.ready.members
    assert {each.filename for each in caught} == {__file__}
