"""Figures of a sweep: plotted values against the sweep's own, and every pose accounted for."""

import subprocess
import sys
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from attrs import evolve
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

from iriftrace.camera.orbit import fibonacci_poses, orbit_poses
from iriftrace.camera.pose import look_at
from iriftrace.camera.pose_set import PoseSet, joined
from iriftrace.figures.style import scale_of, write_figure
from iriftrace.figures.sweep import sweep_charts
from iriftrace.figures.sweep_charts import (
    histogram_figure,
    map_figure,
    normalised_figure,
    pareto_figure,
    rays_figure,
)
from iriftrace.figures.sweep_space import (
    best_at_each_place,
    sweep_scene_figure,
)
from iriftrace.image.aov_image import Status
from iriftrace.planning.criteria import Criteria
from iriftrace.planning.summary import SweepSummary, summarise
from iriftrace.sweep.reload import Surroundings
from validation.inputs.sweep_tables import (
    EMPTY,
    GRID,
    ORBIT,
    known_sweep,
)


@pytest.fixture(scope="module")
def summary() -> SweepSummary:
    return summarise(known_sweep())


def legend_of(figure: Figure) -> list[str]:
    return [t.get_text() for body in figure.subfigs for t in body.legends[0].get_texts()]


def all_axes(figure: Figure) -> list[Any]:
    return [axes for body in figure.subfigs for axes in body.axes]


def test_poses_at_several_distances_are_drawn_over_them() -> None:
    """Each distance has its place, and the displacement the quartiles of its rays."""
    lengths = np.array([300.0, 200.0, 250.0])
    matrices = np.stack([look_at((0.0, -length, 0.0), (0.0, 0.0, 0.0)) for length in lengths])
    table = known_sweep(PoseSet(matrices, np.full(3, 270.0), np.zeros(3)), empty=())
    table["stand_off"] = ("pose", lengths)
    moved = table["displacement_p95"]
    table = table.assign(displacement_p25=0.2 * moved, displacement_p75=0.6 * moved)
    summary = summarise(table)
    figure = map_figure(summary, summary.displacement)
    (axes,) = all_axes(figure)
    line = next(line for line in axes.lines if len(line.get_xdata()) == 3)
    assert line.get_xdata().tolist() == [200.0, 250.0, 300.0]
    np.testing.assert_allclose(line.get_ydata(), summary.displacement.values[[1, 2, 0]])
    band = axes.collections[0].get_paths()[0].vertices
    for length, value in zip(lengths, summary.displacement.values, strict=True):
        inside = np.unique(np.round(band[band[:, 0] == length, 1] / value, 9))
        assert {0.2, 0.6} <= set(inside.tolist())
    assert "Distance" in axes.get_xlabel()
    assert "Quartiles of the displacement of all rays" in legend_of(figure)
    assert not summarise(known_sweep()).is_one_direction


def test_poses_that_were_warned_of_are_crossed(summary: SweepSummary) -> None:
    table = known_sweep()
    table["warned"] = ("pose", np.where(np.isin(np.arange(len(GRID)), (3, 5)), 2, 0).astype("i1"))
    warned = summarise(table)
    for draw in (rays_figure, pareto_figure, lambda s: map_figure(s, s.score)):
        for one, expected in ((summary, 0), (warned, 2)):
            figure = draw(one)
            crosses = [
                # Black on white: dark and light colours of the map both lie behind them.
                len(line.get_xdata())
                for axes in all_axes(figure)
                for line in axes.lines
                if (line.get_mfc(), line.get_mec()) == ("black", "white")
            ]
            assert sum(crosses) == expected
            assert ("Warned of, see the ranking: 2 poses" in legend_of(figure)) == bool(expected)


def test_a_map_shows_every_pose_in_its_cell(summary: SweepSummary) -> None:
    axes, bar = all_axes(map_figure(summary, summary.displacement))
    (mesh,) = [item for item in axes.collections if isinstance(item, QuadMesh)]
    values = np.ma.filled(mesh.get_array(), np.nan)
    np.testing.assert_array_equal(values, summary.displacement.values[summary.grid(np.arange(14))])
    corners = mesh.get_coordinates()
    # Elevations are 45 degrees apart; the cells of the poles end at the poles.
    assert corners[:, 0, 1].tolist() == [-90, -67.5, -22.5, 22.5, 67.5, 90]
    assert corners[0, :, 0].tolist() == [-15, 15, 45, 75, 105]
    assert bar.get_ylabel() == "95th-percentile displacement (µm)"
    assert (axes.get_xlabel(), axes.get_ylabel()) == (
        "Azimuth on the orbit (°)",
        "Elevation on the orbit (°)",
    )


def test_a_map_across_azimuth_0_has_no_gap_and_states_0_to_360() -> None:
    poses = orbit_poses(ORBIT, [-40.0, 0.0, 40.0], [-10.0, 10.0])
    found = summarise(known_sweep(poses, empty=()))
    axes, _ = all_axes(map_figure(found, found.coverage))
    label = axes.xaxis.get_major_formatter()
    assert [label(tick) for tick in axes.get_xticks()] == ["320", "0", "40"]


def test_a_constant_metric_can_be_drawn() -> None:
    data = known_sweep()
    data["coverage_area"][:] = 0.25
    with pytest.warns(UserWarning, match="coverage"):
        found = summarise(data)
    low, high = all_axes(map_figure(found, found.coverage))[0].collections[0].get_clim()
    assert low < 25 < high


def test_histograms_count_every_pose_and_mark_the_limits(summary: SweepSummary) -> None:
    figure = histogram_figure(summary)
    for axes, quantity in zip(all_axes(figure), summary.metrics, strict=True):
        assert sum(bar.get_height() for bar in axes.patches) == len(GRID) - len(EMPTY)
        marked = [line.get_xdata()[0] for line in axes.lines]
        assert marked == pytest.approx(quantity.limits)
        assert axes.get_xlabel() == quantity.label
    assert "Without a number: 2 poses, not shown" in legend_of(figure)


def test_limits_of_an_ensemble_are_said_to_be_those_of_the_means(summary: SweepSummary) -> None:
    plan = evolve(summary.plan, criteria=evolve(summary.plan.criteria, robust=2.0))
    said = legend_of(histogram_figure(evolve(summary, plan=plan)))
    assert "Minimum of the means over the members: normalised to 0" in said
    assert "95th percentile of the means over the members: normalised to 1" in said


LONG = "95th-percentile error along the normal + 2 standard deviations"


def test_long_names_are_not_cut_off_and_do_not_overlap(summary: SweepSummary) -> None:
    """An ensemble and two devices, with rays of all kinds."""
    named = evolve(summary.displacement, title=LONG, name=LONG)
    rays = {status: np.full(len(GRID), 10_000) for status in Status if status != Status.MISSED}
    plan = evolve(summary.plan, criteria=evolve(summary.plan.criteria, robust=2.0))
    table = evolve(summary, displacement=named, rays=rays, warned=np.ones((len(GRID), 1), bool))
    table = evolve(table, plan=plan)
    for figure in (
        map_figure(table, named),
        histogram_figure(table),
        normalised_figure(table),
        rays_figure(table),
    ):
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        renderer = canvas.get_renderer()
        titles = [figure._suptitle, *(body.legends[0] for body in figure.subfigs)]
        labels = [each for axes in all_axes(figure) for each in (axes.xaxis.label, *axes.texts)]
        boxes = [each.get_window_extent(renderer) for each in (*titles, *labels)]
        assert min(box.x0 for box in boxes) >= 0
        assert max(box.x1 for box in boxes) <= figure.bbox.width
        shown = [box for box in boxes if box.width > 1]
        assert not any(a.overlaps(b) for a, b in combinations(shown, 2))


def test_colours_tell_poses_apart_whose_scatter_is_beyond_the_limits(summary: SweepSummary) -> None:
    """The limits are those of means: most poses had the colour of the scale's end."""
    quantity = summary.displacement
    assert scale_of(quantity).limits == quantity.limits
    values = np.geomspace(7.0, 134.0, len(GRID))
    scale = scale_of(evolve(quantity, values=values, limits=(3.0, 50.0), logarithmic=False))
    assert scale.limits == (values[0], values[-1])
    assert scale.logarithmic
    one = scale_of(
        evolve(quantity, values=np.append(values[values < 50.0], 51.0), limits=(3.0, 50))
    )
    assert one.limits == (3.0, 50.0)


def test_rays_are_stacked_to_all_that_hit(summary: SweepSummary) -> None:
    figure = rays_figure(summary)
    upper, _, lower = all_axes(figure)
    top = upper.patches[-1].get_data().values
    known = np.setdiff1d(np.arange(len(GRID)), EMPTY)
    assert top[known].tolist() == sum(summary.rays.values())[known].tolist()
    assert top[list(EMPTY)].tolist() == [0, 0]
    assert lower.patches[0].get_data().values[known].tolist() == (500 + known).tolist()
    assert "Without a number: 2 poses" in legend_of(figure)


def test_the_pareto_front_is_ringed(summary: SweepSummary) -> None:
    figure = pareto_figure(summary)
    others, front = all_axes(figure)[0].collections
    assert len(front.get_offsets()) == len(summary.front)
    assert len(others.get_offsets()) + len(front.get_offsets()) == len(GRID) - len(EMPTY)
    both = np.stack((summary.displacement.values, summary.coverage.values), axis=1)
    np.testing.assert_allclose(front.get_offsets(), both[summary.front])
    assert "Without a number, not shown: 2" in legend_of(figure)


def test_no_text_is_cut_off_or_overlaps() -> None:
    """Labels, titles and tick labels of each figure lie inside it and apart from each other.

    Of two devices, whose error has the longest name.
    """
    data = known_sweep()
    for statistic in ("mean", "median", "p95"):
        data[f"error_normal_{statistic}"] = data[f"displacement_{statistic}"]
    data["coverage_measured"] = data["coverage"]
    data["points_measured"] = data["rays_good"]
    summary = summarise(data)
    figures = [map_figure(summary, quantity) for quantity in summary.quantities]
    figures += [histogram_figure(summary), normalised_figure(summary)]
    figures += [rays_figure(summary), pareto_figure(summary)]
    for figure in figures:
        figure.draw_without_rendering()
        texts = [figure.texts[0], *(body.texts[0] for body in figure.subfigs)]
        texts += [t for body in figure.subfigs for t in body.legends[0].get_texts()]
        for axes in (axes for axes in all_axes(figure) if axes.axison):
            texts += [axes.xaxis.label, axes.yaxis.label]
            for axis in (axes.xaxis, axes.yaxis):
                low, high = sorted(axis.get_view_interval())
                ticks = axis.get_major_ticks()
                texts += [
                    label
                    for tick in ticks
                    if low <= tick.get_loc() <= high
                    for label in (tick.label1, tick.label2)
                    if label.get_visible()
                ]
        boxes = [t.get_window_extent() for t in texts if t.get_text()]
        width, height = figure.bbox.size
        for i, box in enumerate(boxes):
            assert box.x0 >= 0
            assert box.y0 >= 0
            assert box.x1 <= width
            assert box.y1 <= height
            assert not any(box.overlaps(other) for other in boxes[:i])


def test_other_focal_lengths_get_panels_of_their_own() -> None:
    """Two series of the same 14 positions: two grids, each with its poses."""
    twice = joined([GRID, GRID])
    data = known_sweep(twice, empty=())
    data["focal_length"] = ("pose", np.repeat([8.0, 12.0], 14))
    found = summarise(data)
    assert list(found.series) == ["focal length 8 mm", "focal length 12 mm"]
    first, second, _ = all_axes(map_figure(found, found.displacement))
    for axes, members in ((first, np.arange(14)), (second, np.arange(14, 28))):
        (mesh,) = [item for item in axes.collections if isinstance(item, QuadMesh)]
        np.testing.assert_array_equal(
            mesh.get_array(), found.displacement.values[found.grid(members)]
        )
    assert (first.get_title(), second.get_title()) == tuple(found.series)


def test_of_several_at_one_place_the_best_is_shown() -> None:
    """The second series has larger displacements, so the first one is the better everywhere."""
    twice = joined([GRID, GRID])
    found = summarise(known_sweep(twice, empty=()), Criteria(1, 0, 0, 0))
    shown = best_at_each_place(found)
    assert shown.tolist() == [True] * 14 + [False] * 14


def test_drawing_leaves_pyplot_alone() -> None:
    """No global state, and the Matplotlib figures need no VTK."""
    script = (
        "import sys\n"
        "from iriftrace.figures import pose, sweep\n"
        "print([m for m in ('matplotlib.pyplot', 'pyvista', 'mitsuba') if m in sys.modules])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_scattered_poses_are_all_there() -> None:
    found = summarise(known_sweep(fibonacci_poses(ORBIT, 30)))
    axes = all_axes(map_figure(found, found.coverage))[0]
    dots = axes.collections[0].get_offsets()
    marks = [line for line in axes.lines if line.get_markerfacecolor() == "none"]
    assert len(dots) + len(marks[0].get_xdata()) == 30


def test_a_single_pose_can_be_drawn(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="Only one pose"):
        one = summarise(known_sweep(GRID.take([5]), empty=()))
    assert len(sweep_charts(one)) == 9
    figure = sweep_scene_figure(one, one.displacement, Surroundings())
    write_figure(figure, tmp_path / "scene.png")
