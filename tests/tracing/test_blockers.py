"""Bodies that only block the view: a board that is seen past a hot block, and supports."""

from pathlib import Path

import attrs
import matplotlib.image
import numpy as np
import pytest

import iriftrace
from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.figures.window import view
from iriftrace.flow.simulate.bodies import Body, floor_below, write_bodies
from iriftrace.image.aov_image import Status
from iriftrace.io.part_files import save_part
from iriftrace.medium.origin import state_origin
from iriftrace.medium.source import FieldFacts
from iriftrace.part.board import Board
from iriftrace.part.part import part_of_mesh
from iriftrace.tracing.outline import blocker_surfaces
from validation.inputs import hot_block
from validation.inputs.cameras import camera_at

pytestmark = [
    pytest.mark.usefixtures("variant"),
    pytest.mark.filterwarnings("ignore:Hits of this view"),
    pytest.mark.filterwarnings("ignore:.*rays fall on each visible face"),
]

BEHIND = np.array(((1.0, 0, 0, 0), (0, 0, -1.0, 60.0), (0, 1.0, 0, 0), (0, 0, 0, 1.0)))
"""The board's frame to the world's: upright, 60 mm behind the block, facing -y."""

BOARD = Board((60.0, 60.0), 4.0).part.transformed(BEHIND)

CAMERA = camera_at((0.0, -90.0, 3.0), (0.0, 0.0, 3.0), focal_length_mm=20.0, focus_mm=(50.0, 250.0))


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> iriftrace.Scene:
    air, block = hot_block.save(tmp_path_factory.mktemp("user"))
    hot = iriftrace.HotAir(iriftrace.read_field(air), layers=7)
    return iriftrace.Scene(BOARD, hot, CAMERA, blockers=[iriftrace.read_part(block)])


@pytest.mark.parametrize("engine", ["shells", "cells"])
def test_a_board_is_seen_past_the_hot_part(
    scene: iriftrace.Scene, tmp_path: Path, engine: str
) -> None:
    """Blocked where the block alone is seen, else as without it; the files give the same bits."""
    image = iriftrace.render_scene(attrs.evolve(scene, engine=engine)).image
    (block,) = scene.blockers
    of_block = iriftrace.render_scene(
        attrs.evolve(scene, part=block, blockers=(), engine=engine)
    ).image
    hidden = of_block.channels["part.face"] > 0
    assert hidden.sum() > 50
    assert (image.status[hidden] == Status.BLOCKED).all()
    good = image.status == Status.GOOD
    assert good.sum() > 1000
    assert np.hypot(*image.vector("shift.px", good).T).max() > 0.05
    written = scene.save(tmp_path / "scene.xml", scale=1.0)
    again = iriftrace.render_scene(iriftrace.load_scene(written, engine=engine)).image
    for name, values in image.channels.items():
        np.testing.assert_array_equal(again.channels[name], values, err_msg=name)


def test_the_field_is_compared_with_the_body_in_it(scene: iriftrace.Scene) -> None:
    """Not with the board; and the walls of a support in the field are no gap of the part."""
    field, (block,) = scene.air.states[0].field, scene.blockers
    assert field is not None
    fit = iriftrace.fit_part_to_field(field, BOARD, blockers=[block])
    assert fit.warnings == ()
    assert fit.gap_p95_mm < 1e-3
    with pytest.raises(InputError, match="does not reach the part"):
        iriftrace.fit_part_to_field(field, BOARD)
    clipped = np.minimum(block.vertices, (0, 9, 9)), np.maximum(block.vertices, (0, -9, -9))
    halves = [part_of_mesh(vertices, block.faces, name="half") for vertices in clipped]
    assert any(
        "part does not fill" in text
        for text in iriftrace.fit_part_to_field(field, halves[0]).warnings
    )
    past_half = iriftrace.fit_part_to_field(field, BOARD, blockers=halves[:1])
    assert any("The blocker half does not fill" in text for text in past_half.warnings)
    both = iriftrace.fit_part_to_field(field, halves[0], blockers=[halves[1]])
    assert not any("does not fill" in text for text in both.warnings)


def test_a_device_in_a_blocker_is_refused(scene: iriftrace.Scene) -> None:
    camera = CAMERA.at(iriftrace.look_at((0.0, 0.0, 0.5), (0.0, 60.0, 0.0)))
    with pytest.raises(InputError, match=r"stands in the blocker .*block\.stl"):
        iriftrace.render_scene(attrs.evolve(scene, camera=camera))


@pytest.mark.parametrize("engine", ["shells", "cells"])
def test_only_the_part_can_be_hidden(scene: iriftrace.Scene, engine: str) -> None:
    """A floor beside the block's picture counts as missed, not as in the way; below it, all is."""
    (block,) = scene.blockers
    floor = floor_below(hot_block.air(), -hot_block.HALF - 5.0).surface

    def rendered(height: float, *blockers: iriftrace.Part) -> iriftrace.Rendering:
        camera = CAMERA.at(iriftrace.look_at((0.0, -90.0, height), (0.0, 0.0, 0.0)))
        there = attrs.evolve(scene, part=block, blockers=blockers, camera=camera, engine=engine)
        return iriftrace.render_scene(there)

    free, above = rendered(60.0).image, rendered(60.0, floor).image
    # Bent rays that pass the block's edge end on the floor.
    changed = above.status != free.status
    assert set(free.status[changed]) <= {Status.REFRACTED_MISSED}
    assert (free.status == Status.MISSED).sum() > 1000
    with pytest.raises(InputError, match="Another object hides the part from every pixel"):
        rendered(-200.0, floor)


@pytest.mark.slow
def test_command_takes_blockers_and_finds_bodies_of_the_field(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Bodies of a simulation stand beside its field, which names them; a stale one is left out."""
    grid = hot_block.air()
    state_origin(grid, "OpenFOAM, steady", FieldFacts(bodies=("table",)))
    grid.save(tmp_path / "air.vtu")
    hot_block.block().export(tmp_path / "block.stl")
    table = part_of_mesh(BOARD.vertices + np.array((0, 0, -40.0)), BOARD.faces, name="table")
    write_bodies([Body(table), Body(attrs.evolve(table, path="old"))], tmp_path)
    save_part(BOARD, tmp_path / "board.ply")
    scene = tmp_path / "scene" / "scene.xml"
    words = [*map(str, (tmp_path / "air.vtu", tmp_path / "board.ply", "-o", scene))]
    camera = "--resolution=48,40 --scale=1 --sensor=6,5 --focal-length=20 --focus=50:250 "
    camera += "--origin=0,-90,3 --target=0,0,3 --layers=5"
    blocker = ["--blocker", str(tmp_path / "block.stl")]
    assert main(["scene", *words, *blocker, *camera.split()]) == 0
    assert "block the view: " in capsys.readouterr().out
    bodies = [iriftrace.read_part(scene.parent / f"blocker_{k}.ply") for k in (1, 2)]
    np.testing.assert_allclose(bodies[0].bounds, ((-6,) * 3, (6,) * 3), atol=1e-5)
    np.testing.assert_allclose(bodies[1].bounds, table.bounds, atol=1e-5)
    drawn = [np.ptp(vertices, axis=0) for vertices, _ in blocker_surfaces(scene)]
    np.testing.assert_allclose(drawn, [np.ptp(body.bounds, axis=0) for body in bodies], atol=1e-5)
    pictures = [tmp_path / f"{name}.png" for name in ("with", "without")]
    view(iriftrace.load_scene(scene), pictures[0])
    hidden = scene.with_name("hidden.xml")
    hidden.write_text(scene.read_text().replace('id="blocker_', 'id="body_'))
    view(iriftrace.load_scene(hidden), pictures[1])
    shown, bare = map(matplotlib.image.imread, pictures)
    grey = np.ptp(shown[..., :3], axis=2) < 0.1
    assert np.mean(grey & (np.abs(shown - bare).max(axis=2) > 0.1)) > 0.005
    shapes = [shape.id() for shape in iriftrace.load_scene(scene).compiled.mitsuba_scene.shapes()]
    assert {"part", "blocker_1", "blocker_2"} <= set(shapes)
    assert main(["scene", *words, *camera.split()]) == 2
    assert "does not reach the part" in " ".join(capsys.readouterr().err.split())
    grown = ["--expansion=1e-5/K", "--hot-temperature=1000 K"]
    assert main(["scene", *words, *blocker, *grown, *camera.split()]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "is a board that stays cold" in said
    assert said.endswith("this one without expansion (--expansion).")
