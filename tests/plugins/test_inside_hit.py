"""The option ``inside_hit`` of ``first_hit``: rays that leave a shell again are given up."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from iriftrace.image.aov_image import Status
from validation.inputs import small_scenes


def behind_a_ball(folder: Path, **integrator: str) -> dict[str, np.ndarray]:
    """A wall behind a ball of hot air, seen from the front."""
    wall = trimesh.creation.box(
        extents=(80.0, 4.0, 80.0), transform=trimesh.transformations.translation_matrix((0, 20, 0))
    )
    ball = small_scenes.nested_spheres(
        folder, (10.0,), (small_scenes.AMBIENT, small_scenes.HOT), subdivisions=4
    )
    return small_scenes.channels(
        small_scenes.scene({"part": small_scenes.part(folder, wall), **ball}, **integrator)
    )


@pytest.mark.parametrize("normals", ["gradient", "facet"])
def test_rays_through_the_ball_are_given_up_where_they_leave_it(
    variant: str, tmp_path: Path, normals: str
) -> None:
    refracted = behind_a_ball(tmp_path, normals=normals)
    dropped = behind_a_ball(tmp_path, normals=normals, inside_hit="drop")
    assert np.all(refracted["status.code"] == Status.GOOD)
    through = refracted["path.crossings"] == 2
    # The ball's outline is a disc of known size: radius 10 mm at 100 mm, 12.5 px of 48 a side.
    focal_px = 10.0 / (6.0 / 48)
    disc = np.pi * (focal_px * 10.0 / np.sqrt(100.0**2 - 10.0**2)) ** 2
    assert through.sum() == pytest.approx(disc, rel=0.05)
    np.testing.assert_array_equal(
        dropped["status.code"], np.where(through, Status.GAVE_UP, Status.GOOD)
    )
    np.testing.assert_array_equal(dropped["path.crossings"][through], 2)
    for name in ("refracted.X", "displacement.norm"):
        np.testing.assert_array_equal(dropped[name][~through], refracted[name][~through])


def test_rays_that_stay_in_the_hot_air_are_not_touched(variant: str, tmp_path: Path) -> None:
    ball = small_scenes.nested_spheres(
        tmp_path, (10.0,), (small_scenes.AMBIENT, small_scenes.HOT), subdivisions=4
    )
    shapes = {"part": small_scenes.part(tmp_path, small_scenes.sphere(9.0, 4)), **ball}
    default = small_scenes.channels(small_scenes.scene(shapes))
    dropped = small_scenes.channels(small_scenes.scene(shapes, inside_hit="drop"))
    good = default["status.code"] == Status.GOOD
    assert good.sum() > 150
    for name in default:
        np.testing.assert_array_equal(dropped[name], default[name])
