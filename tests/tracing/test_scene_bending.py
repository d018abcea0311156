"""Statements of a scene on where its rays are bent, and shells that are placed by hand."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import trimesh
from attrs import evolve

from iriftrace.core.errors import InputError
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.medium.shells.hessian import HESSIAN_AXES, PLY_COLUMNS
from iriftrace.medium.shells.stack import ShellStack
from iriftrace.part.part import part_of_mesh
from iriftrace.scenes.analytic import concentric_cylinders
from iriftrace.tracing.hot_air import AirState
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.rays import trace_rays
from iriftrace.tracing.render import render_scene
from iriftrace.tracing.write import write_scene
from validation.inputs.cameras import camera_at
from validation.inputs.shell_fields import sphere_field
from validation.paper.shell_edits import smooth_taubin

pytestmark = pytest.mark.usefixtures("variant")

CAMERA = camera_at((0.0, -60.0, 5.0), resolution=(120, 100))
FIELD = sphere_field(12)
BALL = trimesh.creation.icosphere(2, 4.0)
PART = part_of_mesh(BALL.vertices, BALL.faces, name="ball")
TURN = trimesh.transformations.rotation_matrix(np.radians(33.0), (0.6, 0.0, -0.8))[:3, :3]
IN_LAYERS = "layers"
AT_SHELLS = "shells"
NO_DERIVATIVES = "shells without derivatives"


@pytest.fixture(scope="module")
def stack() -> ShellStack:
    return contour_shells(FIELD, 4)


def written(folder: Path, stack: ShellStack) -> Path:
    return write_scene(folder, PART, AirState(FIELD, ready=stack), CAMERA, paraview=False)


@pytest.fixture
def xml(tmp_path: Path, stack: ShellStack) -> Path:
    return written(tmp_path / "scene", stack)


def said(xml: Path, values: Mapping[str, str] | None = None, engine: str = "auto") -> str:
    """What scene, header and metrics say, which is the same."""
    scene = load_scene(xml, values or {}, engine=engine)
    rendering = render_scene(scene)
    header = rendering.image.header
    assert header["bending"] == scene.compiled.bending
    for assumptions in (header["assumptions"], rendering.metrics.assumptions):
        assert assumptions["bending"] == scene.compiled.bending.text
    return str(scene.compiled.bending)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({}, IN_LAYERS),
        ({"bending": "shells"}, AT_SHELLS),
        ({"normals": "facet"}, AT_SHELLS),
        ({"normals": "facet", "bending": "shells"}, AT_SHELLS),
    ],
)
def test_shells_of_a_field_bend_as_they_are_told(
    xml: Path, values: dict[str, str], expected: str
) -> None:
    assert said(xml, values) == expected


def test_the_cells_engine_bends_continuously(xml: Path) -> None:
    assert said(xml, engine="cells") == "cells"


def test_one_shell_without_derivatives_keeps_all_from_it(tmp_path: Path, stack: ShellStack) -> None:
    first, *others = stack.shells
    shells = [evolve(first, derivatives=None), *others]
    assert said(written(tmp_path, evolve(stack, shells=shells))) == NO_DERIVATIVES


@pytest.mark.parametrize("column", ["gradient", "hessian_xx", "hessian_xy"])
def test_a_shell_without_a_column_is_refused(xml: Path, column: str) -> None:
    """As of files that other versions or programs wrote."""
    mesh = xml.parent / "shells/shell_02.ply"
    old, new = f" {column}_".encode(), f" {column[::-1]}_".encode()
    mesh.write_bytes(mesh.read_bytes().replace(old, new, 3))
    with pytest.raises(InputError, match="but the derivatives of the index are"):
        said(xml)


def test_mitsuba_reads_all_that_the_shells_know(xml: Path, stack: ShellStack) -> None:
    import mitsuba as mi

    found = {
        shape.id(): mi.traverse(shape) for shape in load_scene(xml).compiled.mitsuba_scene.shapes()
    }
    for shell in stack.shells:
        values = found[f"shell_{shell.layer:02d}"]
        gradient, *hessian = (np.array(values[f"vertex_{name}"]) for name in PLY_COLUMNS)
        gradient = gradient.reshape(-1, 3)
        assert shell.normals is not None
        assert shell.derivatives is not None
        np.testing.assert_allclose(gradient, shell.normals * shell.derivatives[:, :1], rtol=1e-6)
        np.testing.assert_array_equal(np.stack(hessian, axis=1), shell.derivatives[:, 1:])


def test_smoothed_shells_and_those_of_the_outer_rule_have_no_derivatives(
    tmp_path: Path, stack: ShellStack
) -> None:
    assert said(written(tmp_path / "smooth", smooth_taubin(stack, 2))) == NO_DERIVATIVES
    shells = concentric_cylinders(3, rule="outer")
    exact = write_scene(tmp_path / "exact", *shells, CAMERA, paraview=False)
    assert load_scene(exact).compiled.bending == NO_DERIVATIVES
    assert load_scene(exact, {"bending": "shells"}).compiled.bending == AT_SHELLS


def test_shells_alone_bend_as_if_they_had_no_derivatives(
    xml: Path, tmp_path: Path, stack: ShellStack
) -> None:
    """The parameter takes what is known of the derivatives away, and does matter.

    Normals are the gradient's with derivatives and Mitsuba's without them, which rounds them to
    single precision once more; so hits agree to 6e-11 mm and not to the last bit.
    """
    bare = [evolve(shell, derivatives=None) for shell in stack.shells]
    plain = render_scene(load_scene(written(tmp_path / "bare", evolve(stack, shells=bare)))).image
    told = render_scene(load_scene(xml, {"bending": "shells"})).image
    for name, plane in plain.channels.items():
        np.testing.assert_allclose(told.channels[name], plane, rtol=2e-7, atol=1e-9, err_msg=name)
    layers = render_scene(load_scene(xml)).image
    good = (plain.status == 0) & (layers.status == 0)
    size = plain.channels["displacement.norm"][good]
    ratio = layers.channels["displacement.norm"][good] / size
    # Four shells are up to some per cent off.
    assert 0.01 < np.percentile(np.abs(ratio - 1.0), 95) < 0.5


def test_index_on_the_surface_is_written_where_it_is_needed(
    xml: Path, tmp_path: Path, stack: ShellStack
) -> None:
    loaded = load_scene(xml)
    found = {shape.id(): shape.bsdf() for shape in loaded.compiled.mitsuba_scene.shapes()}
    for shell in stack.shells:
        assert found[f"shell_{shell.layer:02d}"].iso_ior == pytest.approx(
            1.0 + shell.refractivity, abs=1e-15
        )
    # The rim's shell and the next one do not lie midway between their layers.
    assert xml.read_text().count("iso_ior") == 2
    unequal = contour_shells(FIELD, levels=[2.6e-4, 2.5e-4, 2.2e-4])
    loaded = load_scene(written(tmp_path / "unequal", unequal))
    found = {shape.id(): shape.bsdf() for shape in loaded.compiled.mitsuba_scene.shapes()}
    assert any(abs(2 * s.refractivity - s.ext - s.int_) > 1e-6 for s in unequal.shells)
    for shell in unequal.shells:
        assert found[f"shell_{shell.layer:02d}"].iso_ior == pytest.approx(
            1.0 + shell.refractivity, abs=1e-15
        )


def placed(xml: Path, transform: str, *, part: bool = False) -> Path:
    """The scene with its shells, and its part if wanted, placed by hand."""
    placement = f'<transform name="to_world">{transform}</transform>'
    lines = []
    for line in xml.read_text().splitlines():
        named = '"shells/shell_' in line or (part and '"part.ply"' in line)
        lines += [line, placement] if named else [line]
    xml.write_text("\n".join(lines))
    return xml


def with_second_derivatives(stack: ShellStack, turn: np.ndarray) -> ShellStack:
    """Shells whose second derivatives are turned, or made zero, but nothing else."""
    rows, columns = np.array(list(HESSIAN_AXES.values())).T
    shells = []
    for shell in stack.shells:
        assert shell.derivatives is not None
        full = np.empty((len(shell.vertices), 3, 3))
        full[:, rows, columns] = full[:, columns, rows] = shell.derivatives[:, 1:]
        full = turn @ full @ turn.T
        derivatives = np.hstack((shell.derivatives[:, :1], full[:, rows, columns]))
        shells.append(evolve(shell, derivatives=derivatives))
    return evolve(stack, shells=shells)


def test_shells_that_are_scaled_by_hand_bend_at_the_shells_alone(xml: Path) -> None:
    """Their files tell the derivatives per mm of before."""
    scaled = placed(xml, '<scale value="1.1"/>')
    with pytest.raises(InputError, match="'shell_01'") as error:
        load_scene(scaled)
    assert (error.value.code, error.value.argument) == ("shells.stretched", "field_transform")
    assert load_scene(scaled, {"bending": "shells"}).compiled.bending == AT_SHELLS
    assert load_scene(scaled, {"normals": "facet"}).compiled.bending == AT_SHELLS


def test_shells_without_derivatives_may_be_scaled(tmp_path: Path) -> None:
    shells = concentric_cylinders(3, rule="outer")
    exact = write_scene(tmp_path, *shells, CAMERA, paraview=False)
    assert load_scene(placed(exact, '<scale value="1.1"/>')).compiled.bending == NO_DERIVATIVES


def test_turned_shells_bend_turned_rays_alike(xml: Path, tmp_path: Path, stack: ShellStack) -> None:
    """What shells know turns with them: displacements agree to the float32 of the vertices.

    Without the second derivatives, or with those of other axes, they are far from that.
    """
    without = written(tmp_path / "without", with_second_derivatives(stack, np.zeros((3, 3))))
    other = written(tmp_path / "other", with_second_derivatives(stack, TURN))
    axes = np.random.default_rng(5).normal(size=(400, 3))
    outward = axes / np.linalg.norm(axes, axis=1)[:, None]
    aside = np.cross(outward, np.roll(outward, 1, axis=1))
    origins, directions = 40.0 * outward, -40.0 * outward + 2.5 * aside
    before, *others = (
        trace_rays(load_scene(path), origins, directions) for path in (xml, without, other)
    )
    turned_xml = placed(
        xml, '<rotate x="0.6" z="-0.8" angle="33"/><translate x="3" y="-1" z="2"/>', part=True
    )
    scene = load_scene(turned_xml)
    assert scene.compiled.bending == IN_LAYERS
    after = trace_rays(scene, origins @ TURN.T + (3.0, -1.0, 2.0), directions @ TURN.T)
    good = (before.status == 0) & (after.status == 0)
    assert good.sum() > 300
    expected = before.displacement[good] @ TURN.T
    size = np.median(np.linalg.norm(expected, axis=1))
    difference = np.linalg.norm(after.displacement[good] - expected, axis=1)
    assert size > 1e-4
    assert np.percentile(difference, 95) < 1e-3 * size
    for rays in others:
        both = good & (rays.status == 0)
        assert both.sum() > 300
        missed = np.linalg.norm((rays.displacement - before.displacement)[both], axis=1)
        assert np.percentile(missed, 95) > 1e-2 * size
