"""Scenes with the paper's shells: one in files, with its integrator, is what the studies trace."""

from pathlib import Path

import numpy as np
import pytest
from attrs import evolve

from iriftrace.image.aov_image import Status
from iriftrace.medium.index_field import IndexField
from iriftrace.tracing.hot_air import HotAir
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.scene import Scene
from validation.inputs.study_inputs import field_and_scene
from validation.paper.mode import OURS, PAPERS, Mode, shells_of, through_shells
from validation.paper.study import picture
from validation.paper.times import rendered


@pytest.fixture(scope="module")
def block(variant: str, tmp_path_factory: pytest.TempPathFactory) -> tuple[IndexField, Scene]:
    return field_and_scene(tmp_path_factory.mktemp("block"), variant)


def test_a_file_in_the_papers_mode_gives_the_studies_hits(
    block: tuple[IndexField, Scene], tmp_path: Path
) -> None:
    field, coarse = block
    scene = evolve(coarse, camera=evolve(coarse.camera, resolution=(120, 100)))
    stack = shells_of(field, 6, PAPERS)
    assert stack is not None
    xml = tmp_path / "paper" / "scene.xml"
    evolve(scene, air=HotAir(shells=stack, normals=PAPERS.normals)).save(xml, scale=1.0)
    plugin = '<integrator type="first_hit">'
    text = xml.read_text()
    assert plugin in text
    xml.write_text(text.replace(plugin, f'{plugin}<string name="inside_hit" value="drop"/>'))
    image = rendered(load_scene(xml, engine="shells")).image

    hits = picture(through_shells(scene, stack, PAPERS))
    np.testing.assert_array_equal(image.status.ravel() == Status.GOOD, hits.good)
    np.testing.assert_array_equal(
        image.vector("displacement").reshape(-1, 3)[hits.good], hits.displacement[hits.good]
    )
    # Rays that leave the hot air again before they meet the part are dropped.
    ours = rendered(through_shells(scene, stack, OURS)).image
    assert (image.status == Status.GAVE_UP).sum() > (ours.status == Status.GAVE_UP).sum()
    assert "inside are given up" in image.header["assumptions"]["inside_hit"]
    assert "inside_hit" not in ours.header["assumptions"]


def test_levels_count_as_inner_ones_whether_the_field_reaches_them_or_not(
    block: tuple[IndexField, Scene],
) -> None:
    field, _ = block
    too_hot = field.ambient_refractivity, field.hottest_refractivity / 2

    def reached(left_out: int) -> list[int]:
        mode = Mode("m", drop_inner=(left_out,))
        stack = shells_of(field, 6, mode, index_range=too_hot)
        assert stack is not None
        return [shell.layer for shell in stack.shells]

    assert max(reached(0)) < 6
    assert reached(3) == [1, 2, 3]
