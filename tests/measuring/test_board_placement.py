"""Places of a board: predicted U of a feature against actual fits with noise."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import attrs
import numpy as np
import pytest

import iriftrace
from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.core.files import FileOrigin
from iriftrace.io.measured_shift import MeasuredShift
from iriftrace.measuring.fit import board_placement as placement
from iriftrace.measuring.fit.board_placement import (
    BoardPlace,
    board_placement,
    camera_opposite,
    standard_places,
)
from iriftrace.measuring.fit.shift_fit import seen_by_members
from iriftrace.medium.source import FieldFacts, Variation
from validation.inputs.leaning_air import (
    ACROSS,
    BOARD,
    BOARD_CAMERA,
    LEEWARD,
    UPRIGHT,
    hot_block_part,
    leaning,
)

pytestmark = [
    pytest.mark.slow,
    pytest.mark.usefixtures("variant"),
    pytest.mark.filterwarnings("ignore:Hits of this view"),
]

NOISE = 0.05
SIDEWAYS = BOARD_CAMERA.at(iriftrace.look_at((130.0, 0.0, 10.0), (0.0, 0.0, 10.0)))
LEANS = (0.0, 0.2, 0.4, 0.6)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> iriftrace.Scene:
    """A block in plumes that lean towards +x, with two devices to its lee."""
    folder = tmp_path_factory.mktemp("fields")
    air = iriftrace.HotAir([leaning(lean, folder) for lean in LEANS], layers=9)
    camera, second = LEEWARD
    return iriftrace.Scene(hot_block_part(), air, camera, second, "camera_2", engine="shells")


@pytest.fixture(scope="module")
def places(scene: iriftrace.Scene) -> tuple[BoardPlace, ...]:
    """One board behind the plume as seen across its lean, one as seen along it."""
    return board_placement(
        scene,
        BOARD,
        [ACROSS, UPRIGHT],
        cameras=[SIDEWAYS, BOARD_CAMERA],
        noise_px=NOISE,
    )


def test_the_board_that_sees_the_lean_leaves_less(places: tuple[BoardPlace, ...]) -> None:
    best, other = places
    assert (best.number, other.number) == (2, 1)
    assert best.left() < 0.5 * other.left() < 0.5
    # More pictures leave less, down to the noise's root; none leaves what was there before.
    assert best.left(1e-12) == pytest.approx(1.0, abs=1e-6)
    assert best.left(4.0) < best.left(1.0)
    assert best.left(4e6) == pytest.approx(0.5 * best.left(1e6), rel=1e-3)
    enough = best.pictures_for(0.5 * best.left())
    assert enough is not None
    assert best.left(enough) <= 0.5 * best.left() < best.left(enough - 1)
    few = best.dots_for(2.0 * best.left())
    assert few is not None
    assert few < best.dots
    assert best.pictures_for(0.0) is None


@pytest.mark.parametrize("place", [0, 1])
def test_fits_with_noise_scatter_as_predicted(
    scene: iriftrace.Scene, places: tuple[BoardPlace, ...], place: int
) -> None:
    """30 mixtures of the members, each seen with noise and fitted: the feature's error."""
    chosen = places[place]
    to_world = chosen.to_world
    seen = attrs.evolve(
        scene,
        part=BOARD.part.transformed(to_world),
        camera=chosen.camera,
        second=None,
        blockers=(scene.part,),
    )
    dots = BOARD.centres @ to_world[:3, :3].T + to_world[:3, 3]
    hot = chosen.camera.project(dots)
    points, _ = seen_by_members(seen.alone(), chosen.camera, hot)
    known = np.isfinite(points).all(axis=(0, 2)) & chosen.camera.holds(hot)
    shifts = hot - np.array([chosen.camera.project(one) for one in points])
    random = np.random.default_rng(3)
    (feature,) = chosen.features
    errors = []
    for _ in range(30):
        true = random.dirichlet(np.ones(len(LEANS)))
        whole = np.tensordot(true, shifts, axes=1)[known]
        noisy = whole + random.normal(0.0, NOISE, whole.shape)
        measured = MeasuredShift(hot[known] - whole, noisy, None, FileOrigin("twin", ""))
        fit = iriftrace.fit_members(seen, measured, noise_px=NOISE)
        errors.append((fit.weights.weights - true) @ feature.by_member)
    u = 0.5 * float(chosen.expanded()[0])
    # 30 values have a standard deviation that is uncertain by 13 %; that weights are not negative
    # helps the fit, not the prediction.
    assert 0.6 * u < np.sqrt(np.mean(np.square(errors))) < 1.25 * u
    # Without a fit the air is like any of four members or between them.
    prior = random.dirichlet(np.full(4, 2.0 / 3.0 / 4.0), 50_000) @ feature.by_member
    assert prior.std() == pytest.approx(0.5 * feature.before, rel=0.02)


def test_standard_places_face_the_part_and_their_cameras_see_them() -> None:
    part = hot_block_part()
    places = standard_places(part)
    assert len(places) == 8
    for at in places:
        assert np.linalg.det(at[:3, :3]) == pytest.approx(1.0)
        level = at[:3, 3] - part.centre
        assert at[:3, 2] @ level < 0.0
        camera = camera_opposite(LEEWARD[0], part, at)
        x, y = camera.project(at[None, :3, 3])[0]
        assert (x, y) == pytest.approx(tuple((np.array(camera.resolution) - 1) / 2), abs=1e-6)
        distance = np.linalg.norm((camera.origin - part.centre)[:2])
        assert distance == pytest.approx(np.linalg.norm(LEEWARD[0].origin - part.centre), rel=1e-6)
        # The camera looks at the board's face.
        assert at[:3, 2] @ camera.forward < -0.99


def test_the_command_ranks_and_writes(
    scene: iriftrace.Scene, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fine = attrs.evolve(scene, camera=LEEWARD[0].scaled(4.0))
    xml = tmp_path / "scene.xml"
    fine.save(xml, scale=0.25)
    words = ["board", str(xml), "--size=70x70", "--pitch=1.5", "-o", str(tmp_path / "b.json")]
    turned = "rotate x 90,translate 0 60 12"
    across = "rotate x 90,rotate z 90,translate -60 0 12"
    more = ["--place", turned, "--place", across, "--noise=0.01", "--engine", "shells"]
    assert main([*words, *more]) == 0
    written = json.loads((tmp_path / "b.json").read_text())
    best, other = written["places"]
    assert (best["number"], other["number"]) == (1, 2)
    assert best["features"][0]["U_after"] < other["features"][0]["U_after"]
    np.testing.assert_allclose(best["to_world"], UPRIGHT, atol=1e-12)
    said = capsys.readouterr().out
    assert "without a board" in said
    assert main([*words, "--enough=2"]) == 2


def test_a_variation_decides_nothing(
    scene: iriftrace.Scene, places: tuple[BoardPlace, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither dots nor features are those that it sees, too, and it is not traced to the board."""
    fields = [state.field for state in scene.air.states]
    facts = FieldFacts(variation=Variation("wall", 10.0, fields[0].source.sha256))
    wall = attrs.evolve(fields[3], source=attrs.evolve(fields[3].source, sha256="w", facts=facts))
    air = iriftrace.HotAir([fields[0], wall, *fields[1:]], layers=9)
    traced = []

    def seen(scenes: Iterable[iriftrace.Scene], *given: Any) -> tuple[np.ndarray, np.ndarray]:
        traced.append(list(scenes))
        return seen_by_members(traced[-1], *given)

    monkeypatch.setattr(placement, "seen_by_members", seen)
    (found,) = board_placement(
        attrs.evolve(scene, air=air), BOARD, [UPRIGHT], cameras=[BOARD_CAMERA], noise_px=NOISE
    )
    assert [len(each) for each in traced] == [len(LEANS)]
    assert found.dots == places[0].dots
    np.testing.assert_allclose(found.expanded(), places[0].expanded(), rtol=1e-6)


def test_a_place_without_a_dot_is_ranked_last(
    scene: iriftrace.Scene, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It leaves everything, however many pictures are taken, next to a place that sees dots."""
    away = BOARD_CAMERA.at(iriftrace.look_at((0.0, -130.0, 10.0), (0.0, -260.0, 10.0)))
    best, other = board_placement(scene, BOARD, [UPRIGHT, UPRIGHT], cameras=[away, BOARD_CAMERA])
    assert (best.number, other.number, other.dots) == (2, 1, 0)
    assert other.left() == pytest.approx(1.0)
    assert (other.dots_for(0.99), other.pictures_for(0.99)) == (None, None)
    xml = tmp_path / "scene.xml"
    attrs.evolve(scene, camera=LEEWARD[0].scaled(4.0)).save(xml, scale=0.25)
    # The dots of the second board are few, and so near to the part that it hides them.
    words = ["--place", "rotate x 90,translate 0 60 12", "--place", "rotate x 90,translate 0 9 0"]
    assert main(["board", str(xml), "--size=28x28", "--pitch=1", "--engine=shells", *words]) == 0
    assert capsys.readouterr().out.count("no dot is seen") == 1


def test_what_cannot_be_ranked_is_refused(scene: iriftrace.Scene) -> None:
    one = attrs.evolve(scene, air=scene.air.with_states(scene.air.states[:1]))
    away = BOARD_CAMERA.at(iriftrace.look_at((0.0, -130.0, 10.0), (0.0, -260.0, 10.0)))
    for given, options, code in (
        (one, {}, "scene.one_field"),
        (scene, {"noise_px": 0.0}, "noise.not_positive"),
        (scene, {"places": [UPRIGHT], "cameras": [away]}, "board.not_seen"),
        (scene, {"choices": ["plane:plane +z"]}, "feature.no_size"),
    ):
        with pytest.raises(InputError) as error:
            board_placement(given, BOARD, **options)
        assert error.value.code == code
