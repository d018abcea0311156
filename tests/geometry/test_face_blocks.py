"""Sharing out among faces: nothing is lost or made, no face gets more than its area."""

from itertools import pairwise

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from iriftrace.geometry.face_blocks import nest_faces, share_out

GRID = np.stack(np.meshgrid(np.arange(16), np.arange(16), [0]), axis=-1).reshape(-1, 3) * 1.5
ONE_PATCH = np.zeros(len(GRID), dtype=np.int64)


def blocks_of(order: np.ndarray, starts: tuple[np.ndarray, ...], level: int) -> list[np.ndarray]:
    """Face numbers of each block of a level."""
    edges = np.append(starts[level], len(order) if level == 0 else len(starts[level - 1]))
    if level == 0:
        return [order[i:j] for i, j in pairwise(edges)]
    below = blocks_of(order, starts, level - 1)
    return [np.concatenate(below[i:j]) for i, j in pairwise(edges)]


def test_blocks_of_a_grid_are_squares() -> None:
    """The curve of Morton fills a grid of 16 x 16 in squares of 2, 4, 8 and 16."""
    blocks = nest_faces(ONE_PATCH, GRID)
    assert len(blocks.starts) == 4
    for level, size in enumerate((2, 4, 8, 16)):
        found = blocks_of(blocks.order, blocks.starts, level)
        assert len(found) == (16 // size) ** 2
        for block in found:
            assert np.ptp(GRID[block], axis=0).tolist() == [(size - 1) * 1.5] * 2 + [0]


def test_no_block_spans_two_patches() -> None:
    patch = np.random.default_rng(3).integers(0, 5, len(GRID))
    blocks = nest_faces(patch, GRID)
    assert sorted(blocks.order) == list(range(len(GRID)))
    for level in range(len(blocks.starts)):
        for block in blocks_of(blocks.order, blocks.starts, level):
            assert len(set(patch[block])) == 1
    assert len(blocks.starts[-1]) == 5, "the last level's blocks are the patches"


@given(
    seed=st.integers(0, 10_000),
    count=st.integers(1, 300),
    patches=st.integers(1, 4),
    fill=st.floats(0.05, 3),
)
def test_sums_are_kept_and_limits_too(seed: int, count: int, patches: int, fill: float) -> None:
    """Each patch gets all that falls on it, or all that its faces may take."""
    rng = np.random.default_rng(seed)
    patch = rng.integers(0, patches, count)
    limit = rng.lognormal(size=count) * (rng.random(count) > 0.1)
    amount = fill * limit.mean() * rng.exponential(size=count) * (rng.random(count) > 0.4)
    may_take = rng.random(count) > 0.3
    got = share_out(amount, limit, may_take, nest_faces(patch, rng.normal(size=(count, 3))))
    assert (got <= limit).all(), "exactly, not within rounding"
    cut = np.minimum(amount, limit)
    np.testing.assert_allclose(got[~may_take], cut[~may_take], rtol=0, atol=1e-15 * limit.max())
    assert (got >= cut - 1e-15 * limit.max()).all()
    for number in range(patches):
        own = patch == number
        most = cut[own].sum() + (limit - cut)[own & may_take].sum()
        expected = min(amount[own].sum(), most)
        assert got[own].sum() == pytest.approx(expected, rel=1e-12, abs=1e-12 * limit.max())


def test_excess_stays_close_by() -> None:
    """Every second face has twice its area and the rest nothing: no face keeps anything to spare.

    Their room lies in the same block of four, so each block is filled from itself alone: a hole of
    8 x 8 faces without any rays stays empty.
    """
    far = (GRID < 12).all(axis=1)
    amount = np.where(np.arange(len(GRID)) % 2 == 0, 2.0, 0.0)
    amount[far] = 0
    got = share_out(amount, np.ones(len(GRID)), ONE_PATCH == 0, nest_faces(ONE_PATCH, GRID))
    np.testing.assert_allclose(got, np.where(far, 0.0, 1.0))


def test_faces_of_no_extent_do_no_harm() -> None:
    centres = np.zeros((7, 3))
    blocks = nest_faces(np.zeros(7, dtype=np.int64), centres)
    got = share_out(np.full(7, 0.5), np.zeros(7), np.ones(7, dtype=bool), blocks)
    assert (got == 0).all()


def test_large_mesh_keeps_its_sum() -> None:
    """80,000 faces of a sphere with random footprints, one of them as large as 3,000 faces."""
    mesh = trimesh.creation.icosphere(subdivisions=6, radius=20)
    limit = np.asarray(mesh.area_faces)
    rng = np.random.default_rng(8)
    amount = 0.5 * limit * rng.poisson(2, len(limit)) * (mesh.triangles_center[:, 0] > 0)
    amount[np.argmax(mesh.triangles_center[:, 0])] = 3000 * limit.mean()
    blocks = nest_faces(np.zeros(len(limit), dtype=np.int64), mesh.triangles_center)
    got = share_out(amount, limit, mesh.triangles_center[:, 0] > -5, blocks)
    assert (got <= limit).all()
    assert got.sum() == pytest.approx(amount.sum(), rel=1e-13)
    assert (got[mesh.triangles_center[:, 0] < -5] == 0).all()
