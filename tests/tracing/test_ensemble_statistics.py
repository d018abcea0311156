"""Mean, scatter and worst member of images made by hand, against NumPy's."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.core.errors import InputError
from iriftrace.core.member_weights import MemberWeights
from iriftrace.image.aov_image import CHANNELS, MEMBERS_CHANNEL, SCATTER_CHANNELS, AovImage, Status
from iriftrace.image.ray_statistics import Statistics, ensemble_metrics
from iriftrace.io.exr import read_exr, write_exr
from iriftrace.tracing.pose_image import EnsembleStatistics
from validation.inputs.cameras import camera_at
from validation.oracles.aov_by_hand import make_image, plate

CAMERA = camera_at((0.0, -100.0, 0.0), resolution=(24, 20))
PLATE = plate((20.0, 0, 0), (0, 0, 18.0), (0, 0, 0))


def images(count: int, lost: float = 0.0) -> list[AovImage]:
    """Images of a plate with random displacements, and a share of the rays lost in each."""
    random = np.random.default_rng(7)
    made = []
    for _ in range(count):
        status = np.where(random.random((20, 24)) < lost, Status.REFRACTED_MISSED, Status.GOOD)
        good = (status == Status.GOOD)[..., None]
        made.append(
            make_image(
                CAMERA,
                PLATE,
                displacement=good * random.normal(3e-3, 1e-3, (20, 24, 3)),
                shift=good * random.normal(0.1, 0.02, (20, 24, 2)),
                status=status,
            )
        )
    return made


def combined(
    members: Sequence[AovImage], weights: Sequence[float] | None = None, **header: Any
) -> AovImage:
    statistics = EnsembleStatistics()
    for image, weight in zip(members, weights or (1.0,) * len(members), strict=True):
        statistics.add(image, weight)
    return statistics.image(header)


@pytest.mark.parametrize("weights", [(1.0,) * 3, (0.5, 0.3, 0.2), (0.7, 0.3, 0.0)])
def test_weights_are_those_of_numpy(weights: tuple[float, ...]) -> None:
    """Against NumPy's covariance with weights (``aweights``), and the largest displacement."""
    members = images(3)
    found = combined(members, weights)
    seen = members[0].channels["part.face"] > 0
    values = np.stack([image.channels["displacement.X"][seen].astype(float) for image in members])
    mean = np.average(values, axis=0, weights=weights)
    assert_allclose(found.channels["displacement.X"][seen], mean, rtol=1e-6)
    deviation = [np.sqrt(np.cov(column, aweights=weights)) for column in values.T]
    assert_allclose(found.channels["displacement.std.X"][seen], deviation, rtol=1e-5)
    assert_allclose(MemberWeights(weights).scatter(values), deviation, rtol=1e-9)
    norms = np.stack([image.channels["displacement.norm"][seen] for image in members])
    assert_array_equal(found.channels["ensemble.worst"][seen], norms.argmax(axis=0) + 1)
    assert_array_equal(found.channels["displacement.worst.norm"][seen], norms.max(axis=0))


def test_weights_that_are_none_are_refused() -> None:
    for weights in ((-0.1, 1.1), (0.0, 0.0), (1.0, np.nan)):
        with pytest.raises(InputError, match="weights"):
            MemberWeights(weights)


def test_mean_and_deviation_are_those_of_numpy() -> None:
    """Pixel by pixel, over the members in which the ray counts; the deviation is a sample's."""
    members = images(6, lost=0.4)
    found = combined(members)
    good = np.stack([image.status == Status.GOOD for image in members])
    counted = good.sum(axis=0)
    seen = members[0].channels["part.face"] > 0
    assert_array_equal(found.channels[MEMBERS_CHANNEL], np.where(seen, counted, 0))
    assert set(np.unique(counted[seen])) >= {1, 2, 6}
    for name in ("displacement.X", "displacement.Y", "displacement.Z", "shift.px.X", "shift.px.Y"):
        values = np.ma.array([image.channels[name].astype(float) for image in members], mask=~good)
        mean = values.mean(axis=0).filled(0.0)
        assert_allclose(found.channels[name], np.where(seen, mean, 0.0), rtol=1e-6, atol=1e-12)
        deviation = np.ma.where(counted > 1, values.std(axis=0, ddof=1), 0.0).filled(0.0)
        quantity, axis = name.rsplit(".", 1)
        expected = np.where(seen, deviation, 0.0)
        assert_allclose(found.channels[f"{quantity}.std.{axis}"], expected, rtol=1e-5, atol=1e-12)
    axes = [found.channels[f"displacement.std.{axis}"] for axis in "XYZ"]
    total = np.sqrt(sum(a.astype(float) ** 2 for a in axes))
    assert_allclose(found.channels["displacement.std.norm"], total, rtol=1e-6)


def test_a_pixel_is_good_if_it_is_in_every_member() -> None:
    members = images(4, lost=0.3)
    status = combined(members).status
    states = np.stack([image.status for image in members])
    assert_array_equal(status == Status.GOOD, (states == Status.GOOD).all(axis=0))
    partly = (states != Status.GOOD).any(axis=0) & (states[0] != Status.MISSED)
    assert (status[partly] == Status.REFRACTED_MISSED).all()


def test_equal_members_scatter_not_at_all() -> None:
    (image,) = images(1)
    found = combined([image] * 3)
    for name in (name for name in SCATTER_CHANNELS if ".std." in name):
        assert_array_equal(found.channels[name], 0.0)
    norm = image.channels["displacement.norm"]
    assert_allclose(found.channels["displacement.norm"], norm, rtol=1e-6)


def test_other_parts_are_refused() -> None:
    other = plate((20.0, 0, 0), (0, 0, 18.0), (0, 0, 0), cells=3)
    with pytest.raises(InputError, match="different parts"):
        combined([*images(1), make_image(CAMERA, other)])


def test_channels_survive_the_file(tmp_path: Path) -> None:
    written = combined(images(3), **images(1)[0].header, ensemble={"count": 3})
    write_exr(tmp_path / "a.exr", written)
    found = read_exr(tmp_path / "a.exr")
    assert set(found.channels) == {*CHANNELS, *SCATTER_CHANNELS}
    for name in found.channels:
        assert_array_equal(found.channels[name], written.channels[name])
    assert found.vector("displacement.std").shape == (20, 24, 3)


def test_metrics_tell_bias_from_scatter() -> None:
    members = images(5)
    found = combined(members, ensemble={"count": 5})
    pixels = np.flatnonzero(found.channels["part.face"])
    metrics = ensemble_metrics(found, pixels, pixels)
    worst = np.max([image.channels["displacement.norm"].ravel()[pixels] for image in members], 0)
    assert metrics.worst_mm.p95 == pytest.approx(np.percentile(worst, 95), rel=1e-6)
    assert metrics.worst_member in range(1, 6)
    assert metrics.members == metrics.rays_in_all // len(pixels) * 5
    # Three independent components of 1 um each.
    assert metrics.scatter_mm.rms == pytest.approx(np.sqrt(3) * 1e-3, rel=0.05)
    few = ensemble_metrics(found, pixels[:99], pixels)
    assert few.scatter_mm == Statistics()
