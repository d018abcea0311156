"""Scenes in the paper's mode: what `iriftrace scene` writes is what the studies trace."""

import json
from pathlib import Path

import numpy as np
import pytest

from iriftrace.cli import main
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.field.read import read_field
from iriftrace.image.aov_image import Status, read_exr
from iriftrace.part.part import read_part
from iriftrace.scene.hot_air import HotAir
from iriftrace.scene.scene import Scene
from iriftrace.shells.contour import contour_shells
from iriftrace.shells.edit import without_inner
from iriftrace.studies.mode import Mode, shells_of, through_shells
from iriftrace.studies.study import picture
from validation.inputs import hot_block
from validation.inputs.hot_block import HotBlock

PAPERS = [
    *("--normals=facet", "--rule=outer", "--inside-hit=drop"),
    *("--drop-inner=2", "--layers=6"),
]


def test_scene_in_the_papers_mode_gives_the_studies_hits(
    hot: HotBlock, tmp_path: Path, variant: str
) -> None:
    xml = tmp_path / "paper" / "scene.xml"
    arguments = ["scene", str(hot.field), str(hot.part), "-o", str(xml), *PAPERS]
    assert main([*arguments, *hot_block.CAMERA]) == 0
    assert main(["render", str(xml), "--no-figures"]) == 0
    image = read_exr(xml.with_suffix(".exr"))

    mode = Mode("paper's", "facet", "outer", "drop", (2,))
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
    assert assumed["shells"] == "the 2 innermost left out"
    assert "inside are given up" in assumed["inside_hit"]
    ours = json.loads(hot.image.with_suffix(".json").read_text())["assumptions"]
    assert not {"shells", "inside_hit"} & set(ours)


def test_levels_count_as_inner_ones_whether_the_field_reaches_them_or_not(hot: HotBlock) -> None:
    field = read_field(hot.field)
    ambient, hottest = field.ambient_refractivity, field.hottest_refractivity
    with pytest.warns(IriftraceWarning, match="level 6"):
        stack = contour_shells(field, 6, index_range=(ambient, hottest / 2))
    reached = [shell.layer for shell in stack.shells]
    assert max(reached) < 6
    assert [s.layer for s in without_inner(stack, 3, levels=6).shells] == [1, 2, 3]
    assert [s.layer for s in without_inner(stack, 1).shells] == reached[:-1]
    with pytest.raises(InputError, match="cannot be left out"):
        without_inner(stack, -1)
