"""Studies of layers, smoothing and meshes on the hot block."""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from attrs import evolve

from iriftrace.core.errors import InputError
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.tracing.scene import Scene
from validation.inputs.study_inputs import field_and_scene
from validation.paper.figures import comparison_figure
from validation.paper.kinds import layers_study, mesh_study, smoothed, smoothing_study
from validation.paper.mode import OURS, PAPERS, Mode, through_cells, through_shells
from validation.paper.study import DIFFERENCES, SIZES, Setup, picture, run_study

FACETS = Mode("facets", normals="facet")


@pytest.fixture(scope="module")
def block(variant: str, tmp_path_factory: pytest.TempPathFactory) -> tuple[IndexField, Scene]:
    return field_and_scene(tmp_path_factory.mktemp("block"), variant)


@pytest.fixture(scope="module")
def layers(block: tuple[IndexField, Scene], tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    study = layers_study(
        Setup(block[1], {"f": block[0]}, [OURS, PAPERS]),
        layers=[1, 3, 6],
        references=["6", "cells"],
    )
    return run_study(study, tmp_path_factory.mktemp("layers") / "layers.nc")


def test_layers_have_every_statistic_with_its_unit(layers: xr.Dataset, variant: str) -> None:
    for name, (unit, *_) in DIFFERENCES.items():
        assert layers[name].dims == ("mode", "layers", "reference")
        assert layers[name].attrs["units"] == unit
    for name, (unit, *_) in SIZES.items():
        assert layers[name].dims == ("mode", "layers")
        assert layers[name].attrs["units"] == unit
    assert json.loads(layers.attrs["modes"])[1]["index_rule"] == "outer"
    assert layers.attrs["variant"] == variant


def test_a_stack_differs_from_itself_by_nothing(layers: xr.Dataset) -> None:
    same = layers.sel(layers=6, reference="6")
    for name in ("rmse", "rmse_trimmed", "median", "p95", "only_here", "only_reference"):
        np.testing.assert_array_equal(same[name], 0)
    np.testing.assert_array_equal(same["matched"], layers["rays_good"].sel(layers=6))


def test_one_shell_of_the_outer_rule_is_none(layers: xr.Dataset) -> None:
    none = layers.sel(layers=1, mode="paper's")
    assert np.isnan(none["rmse"]).all()
    assert np.isnan(none["displacement_median"])
    np.testing.assert_array_equal(none["matched"], -1)
    assert int(layers["shells"].sel(layers=6, mode="paper's")) == 5


def test_ours_is_nearer_to_the_continuous_engine_than_the_papers(layers: xr.Dataset) -> None:
    median = layers["median"].sel(reference="cells")
    ours, papers = median.sel(mode="ours").values, median.sel(mode="paper's").values
    # The outer rule is off by half a step of the index, an error of first order.
    # Three shells of ours are two equal steps and one shell outside.
    assert ours[1] < papers[1]
    assert ours[2] < 0.5 * papers[2]


def test_rmse_is_that_of_the_rays(block: tuple[IndexField, Scene], layers: xr.Dataset) -> None:
    field, scene = block
    stack = contour_shells(field, 3)
    here = picture(through_shells(scene, stack, OURS))
    reference = picture(through_cells(scene, field))
    both = here.good & reference.good
    squares = ((here.displacement - reference.displacement)[both] ** 2).sum(axis=1)
    found = layers["rmse"].sel(mode="ours", layers=3, reference="cells")
    assert float(found) == pytest.approx(float(np.sqrt(squares.mean())), rel=1e-6)


def test_figures_have_a_column_for_each_reference(layers: xr.Dataset) -> None:
    figure = comparison_figure(layers)
    (body,) = figure.subfigs
    assert [axes.get_title() for axes in body.axes[:2]] == [
        "Against 6 shells of the same mode",
        "Against the cells engine",
    ]


@pytest.mark.parametrize("name", ["0", "fine", "-3"])
def test_unknown_references_are_refused(block: tuple[IndexField, Scene], name: str) -> None:
    with pytest.raises(InputError, match="not a reference"):
        layers_study(Setup(block[1], {"f": block[0]}, [OURS]), layers=[2], references=[name])


def test_no_smoothing_of_the_finest_field_changes_nothing(
    block: tuple[IndexField, Scene], tmp_path: Path
) -> None:
    field, scene = block
    study = smoothing_study(
        Setup(scene, {"a": field, "b": field}, [OURS, FACETS]),
        iterations=[0, 5],
        layers=3,
        references=["same mode"],
    )
    found = run_study(study, tmp_path / "smoothing.nc").sel(reference="same mode")
    np.testing.assert_array_equal(found["rmse"].sel(iterations=0), 0)
    assert (found["rmse"].sel(iterations=5) > 0).all()
    # Smoothing turns facets; the directions of the gradient stay, so it does less to ours.
    ours, facets = found["median"].sel(iterations=5).values
    assert ours < 0.5 * facets
    comparison_figure(run_study(study, tmp_path / "smoothing.nc"))


def test_smoothing_keeps_the_gradient_at_each_vertex(block: tuple[IndexField, Scene]) -> None:
    stack = contour_shells(block[0], 2)
    for before, after in zip(stack.shells, smoothed(stack, 3).shells, strict=True):
        assert before.normals is not None
        np.testing.assert_array_equal(after.normals, before.normals)
        assert before.derivatives is not None
        np.testing.assert_array_equal(after.derivatives, before.derivatives)
        assert not np.array_equal(after.vertices, before.vertices)
    facets = [evolve(shell, normals=None, derivatives=None) for shell in stack.shells]
    assert not smoothed(evolve(stack, shells=facets), 3).has_normals


def test_meshes_are_compared_with_the_last_and_splitting_adds_coplanar_triangles_only(
    variant: str, tmp_path: Path
) -> None:
    coarse, _ = field_and_scene(tmp_path, variant, cells=9)
    fine, scene = field_and_scene(tmp_path, variant, cells=18)
    study = mesh_study(
        Setup(scene, {"coarse": coarse, "fine": fine}, [OURS, FACETS]),
        references=["same mode"],
        layers=3,
        split=["coarse"],
    )
    found = run_study(study, tmp_path / "mesh.nc").sel(reference="same mode")
    assert list(found["field"].values) == ["coarse", "coarse as tetrahedra", "coarse+", "fine"]
    np.testing.assert_array_equal(found["rmse"].sel(field="fine"), 0)
    assert (found["median"].sel(field="coarse") > 0).all()
    facets = found.sel(mode="facets")
    before, after = (facets.sel(field=name) for name in ("coarse as tetrahedra", "coarse+"))
    assert int(after["triangles"]) > 3 * int(before["triangles"])
    # Vertices are rounded to single precision, which turns facets by 1e-6.
    for name in ("displacement_median", "displacement_p95"):
        assert float(after[name]) == pytest.approx(float(before[name]), rel=2e-3)
    comparison_figure(run_study(study, tmp_path / "mesh.nc"))


def test_a_study_of_meshes_needs_two_fields_and_known_names(
    block: tuple[IndexField, Scene],
) -> None:
    field, scene = block
    with pytest.raises(InputError, match="at least two fields"):
        mesh_study(Setup(scene, {"a": field}, [OURS]), references=["same mode"])
    two = Setup(scene, {"a": field, "b": field}, [OURS])
    with pytest.raises(InputError, match="no field c to split"):
        mesh_study(two, references=["same mode"], split=["c"])
    with pytest.raises(InputError, match="not a reference"):
        mesh_study(two, references=["best"])
    with pytest.raises(InputError, match="leaves none"):
        mesh_study(evolve(two, modes=[evolve(OURS, drop_inner=[0, 3])]), layers=3)
