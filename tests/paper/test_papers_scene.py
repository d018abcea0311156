"""Scenes with the paper's shells: what `iriftrace scene` writes is what the studies trace."""

import json
from pathlib import Path

import numpy as np

from iriftrace.cli import main
from iriftrace.field.read import read_field
from iriftrace.image.aov_image import Status, read_exr
from iriftrace.part.part import read_part
from iriftrace.scene.hot_air import HotAir
from iriftrace.scene.scene import Scene
from validation.paper.mode import Mode, shells_of, through_shells
from validation.paper.study import picture
from validation.inputs import hot_block
from validation.inputs.hot_block import HotBlock

PAPERS = ["--normals=facet", "--rule=outer", "--inside-hit=drop", "--layers=6"]


def test_scene_in_the_papers_mode_gives_the_studies_hits(
    hot: HotBlock, tmp_path: Path, variant: str
) -> None:
    xml = tmp_path / "paper" / "scene.xml"
    arguments = ["scene", str(hot.field), str(hot.part), "-o", str(xml), *PAPERS]
    assert main([*arguments, *hot_block.CAMERA]) == 0
    assert main(["render", str(xml), "--no-figures"]) == 0
    image = read_exr(xml.with_suffix(".exr"))

    mode = Mode("paper's", "facet", "outer", "drop")
    field = read_field(hot.field)
    stack = shells_of(field, 6, mode)
    assert stack is not None
    scene = Scene(read_part(hot.part), HotAir(field), image.camera, variant=variant)
    hits = picture(through_shells(scene, stack, mode))
    np.testing.assert_array_equal(image.status.ravel() == Status.GOOD, hits.good)
    np.testing.assert_array_equal(
        image.vector("displacement").reshape(-1, 3)[hits.good], hits.displacement[hits.good]
    )
    # Rays that leave the hot air again before they meet the part are dropped.
    assert (image.status == Status.GAVE_UP).sum() > (
        read_exr(hot.image).status == Status.GAVE_UP
    ).sum()
    assumed = json.loads(xml.with_suffix(".json").read_text())["assumptions"]
    assert "inside are given up" in assumed["inside_hit"]
    ours = json.loads(hot.image.with_suffix(".json").read_text())["assumptions"]
    assert "inside_hit" not in ours


def test_levels_count_as_inner_ones_whether_the_field_reaches_them_or_not(hot: HotBlock) -> None:
    field = read_field(hot.field)
    too_hot = field.ambient_refractivity, field.hottest_refractivity / 2

    def reached(left_out: int) -> list[int]:
        mode = Mode("m", drop_inner=(left_out,))
        stack = shells_of(field, 6, mode, index_range=too_hot)
        assert stack is not None
        return [shell.layer for shell in stack.shells]

    assert max(reached(0)) < 6
    assert reached(3) == [1, 2, 3]
