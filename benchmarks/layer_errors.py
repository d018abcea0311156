"""Where on their way shells bend rays wrongly: ``python -m benchmarks.layer_errors FIELD X,Y,Z``.

FIELD is one that the tree keeps (`benchmarks.solved_fields`); any number of camera positions, in
mm, from which the origin is looked at. Along straight rays through the field the turns that the
layers' formulas give (`iriftrace.plugins.kernels.layers`) are compared with the integral of the
continuous engine's gradient, piece by piece: outside the outermost shell, on the way back to the
shell that a ray comes from, and elsewhere. Printed are differences of the hits over the
displacement, median by median and p95 by p95: as traced, as this model has it, and with the
integral in place of one or both of the first two pieces.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from attrs import frozen
from rich.console import Console
from rich.table import Table

from benchmarks.accuracy.agreement import share
from benchmarks.engines import camera_at
from benchmarks.solved_fields import SOLVED
from benchmarks.straight_ways import BoolArray, FloatArray, IntArray, Ways, between, straight_ways
from iriftrace.field.index_field import IndexField
from iriftrace.image.aov_image import Status
from iriftrace.part.part import Part
from iriftrace.plugins.kernels.layers import Layer, outside, slope_of
from iriftrace.runtime.variant import ensure
from iriftrace.scene.load import load_scene
from iriftrace.scene.write import write_scene
from iriftrace.shells.contour import contour_shells
from iriftrace.shells.hessian import outer_derivatives
from iriftrace.shells.levels import index_levels
from iriftrace.trace.render import RayHits, trace_rays

RAYS = 800

OUTSIDE, TURNING, ELSEWHERE = range(3)
REPLACED: dict[str, tuple[int, ...]] = {
    "model": (),
    "outside exact": (OUTSIDE,),
    "turning exact": (TURNING,),
    "both exact": (OUTSIDE, TURNING),
}


@frozen(eq=False)
class Crossings:
    """Where rays cross shells, ray by ray and in their order.

    Attributes
    ----------
    ray : (c,) array of int
    place : (c,) array
        As in :class:`Ways`, between the places there.
    level : (c,) array of int
        Number of the shell, from 0 outside.
    inward : (c,) array of bool
    """

    ray: IntArray
    place: FloatArray
    level: IntArray
    inward: BoolArray

    @property
    def last(self) -> BoolArray:
        """Crossings after which their ray crosses no shell."""
        return np.append(self.ray[1:] != self.ray[:-1], True)

    @property
    def first(self) -> BoolArray:
        """Crossings before which it crosses none."""
        return np.roll(self.last, 1)

    def step_before(self, values: FloatArray) -> FloatArray:
        """Values (c, ...) at the crossing before on the same ray; 0 where there is none."""
        found = np.roll(values, 1, axis=0)
        found[self.first] = 0
        return found


def crossings(ways: Ways, surfaces: FloatArray) -> Crossings:
    """Where the index of the air along rays is that of shells, n - 1."""
    before, behind = ways.refractivity[:, :-1], ways.refractivity[:, 1:]
    known = ways.known[:, :-1] & ways.known[:, 1:]
    found = []
    for level, surface in enumerate(surfaces):
        ray, place = np.nonzero(((before < surface) != (behind < surface)) & known)
        low, high = before[ray, place], behind[ray, place]
        at = place + (surface - low) / (high - low)
        found.append((ray, at, np.full(len(ray), level), high < low))
    ray, at, level, inward = (np.concatenate(column) for column in zip(*found, strict=True))
    order = np.lexsort((at, ray))
    return Crossings(ray[order], at[order], level[order], inward[order])


def errors(ways: Ways, field: IndexField, layers: int, rule: str) -> FloatArray:
    """How far beside their hits rays end because of each piece, um: (3, r, 3) array."""
    ambient = field.ambient_refractivity
    surfaces, air = index_levels(ambient, field.hottest_refractivity, layers, rule)
    at = crossings(ways, surfaces)
    last, first = at.last, at.first
    behind, ahead = air[at.level], air[at.level + 1]
    near, far = np.where(at.inward, (behind, ahead), (ahead, behind))
    level = surfaces[at.level]
    made = _bent(ways, field, at, (level, near, far))

    upto = between(ways.aside, at.ray, at.place + 0.5)
    end = ways.aside[at.ray[last], -1]
    exact = np.concatenate((upto - at.step_before(upto), end - upto[last]))
    in_ambient = [np.abs(n - ambient) < 1e-3 * np.abs(n - level) for n in (near, far)]
    back = ~first & (level == at.step_before(level))
    kind = np.where(first | (back & in_ambient[0]), OUTSIDE, np.where(back, TURNING, ELSEWHERE))
    kind = np.append(kind, np.where(in_ambient[1], OUTSIDE, ELSEWHERE)[last])
    found = np.zeros((3, len(ways.length), 3))
    np.add.at(found, (kind, np.append(at.ray, at.ray[last])), made - exact)
    unmet = np.setdiff1d(np.arange(len(ways.length)), at.ray)
    found[OUTSIDE, unmet] = -ways.aside[unmet, -1]
    return found


def _bent(
    ways: Ways, field: IndexField, at: Crossings, indices: tuple[FloatArray, ...]
) -> FloatArray:
    """How far beside their hits rays end by the turns before each crossing and after the last.

    (c + l, 3) array, um; `indices` are n - 1 of the shell and of the layers before and behind it.
    """
    import mitsuba as mi

    last = at.last
    way = ways.distance(at.ray, at.place)
    left = ways.length[at.ray] - way
    heading = ways.direction[at.ray]
    pull, change = _gradients(ways, field, at, indices[0])
    level, near, far, ambient = (
        1 + n for n in (*indices, np.full(len(way), field.ambient_refractivity))
    )
    layer = Layer(
        slope_of(_vector(at.step_before(pull)), _vector(at.step_before(change))),
        slope_of(_vector(pull), _vector(change)),
        *(mi.Float64(n) for n in (at.step_before(level), level, near, ambient)),
    )
    length = mi.Float(way - at.step_before(way))
    turn, aside = _rows(layer.turn(_vector(heading), length, mi.Bool(at.first)))
    slope = slope_of(_vector(pull[last]), _vector(change[last]))
    air = (mi.Float64(n[last]) for n in (level, far, ambient))
    tail = outside(slope, *air, _vector(heading[last]), mi.Float(left[last]), 1)
    late_turn, late = _rows(tail)
    ends = aside + turn * left[:, None], late_turn * left[last, None] - late
    return 1e3 * np.concatenate(ends)


def _gradients(
    ways: Ways, field: IndexField, at: Crossings, level: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Gradient at crossings and its change along the ray, as the shells' vertices know them."""
    pull = between(ways.gradient, at.ray, at.place)
    second = between(ways.second, at.ray, at.place).reshape(-1, 3, 3)
    heading = ways.direction[at.ray]
    points = ways.origin[at.ray] + ways.distance(at.ray, at.place)[:, None] * heading
    grid = field.grid.copy()
    grid.point_data["gradient"] = field.fitting_gradient
    outer = at.level == 0
    second[outer] = outer_derivatives(
        grid, points[outer], pull[outer], level[outer][0], field.ambient_refractivity
    )
    return pull, np.einsum("ijk,ik->ij", second, heading)


def _vector(rows: FloatArray) -> Any:
    import mitsuba as mi

    return mi.Vector3f(np.ascontiguousarray(rows.T, dtype=np.float32))


def _rows(vectors: tuple[Any, Any]) -> list[FloatArray]:
    return [np.array(vector, dtype=np.float64).T for vector in vectors]


def good_rays(scenes: list[Any], position: tuple[float, ...]) -> tuple[FloatArray, list[RayHits]]:
    """Origins (r, 3), mm, of rays that are good in all scenes, and their hits there."""
    rng = np.random.default_rng(0)
    camera = camera_at(position)
    origin, direction = camera.rays(rng.uniform((0, 0), camera.resolution, (8 * RAYS, 2)))
    hits = [trace_rays(scene, origin, direction) for scene in scenes]
    good = np.all([one.status == Status.GOOD for one in hits], axis=0)
    chosen = np.flatnonzero(good)[:RAYS]
    return origin[chosen], [trace_rays(s, origin[chosen], direction[chosen]) for s in scenes]


@frozen(eq=False)
class Found:
    """Displacements (r, 3) and what makes them differ, um.

    Attributes
    ----------
    engine, shells : (r, 3) arrays
        Displacements as traced.
    pieces : (3, r, 3) array
        Differences that the model has, along the part, by the piece of the way.
    """

    engine: FloatArray
    shells: FloatArray
    pieces: FloatArray

    def without(self, *exact: int) -> FloatArray:
        """The model's differences (r, 3) if some pieces were exact."""
        rest: FloatArray = self.pieces.sum(axis=0) - self.pieces[list(exact)].sum(axis=0)
        return rest

    def share(self, difference: FloatArray) -> tuple[float, float]:
        """Median and p95 of differences (r, 3) over those of the displacement, per cent."""
        sizes = (np.linalg.norm(values, axis=1) for values in (difference, self.engine))
        return share(*sizes)[:2]


def found_from(
    field: IndexField, part: Part, scenes: list[Any], position: tuple[float, ...], made: Any
) -> Found:
    """Trace and model rays from a position, mm; `made` are the number of shells and their rule."""
    origin, (shells, engine) = good_rays(scenes, position)
    ways = straight_ways(field, origin, shells.straight)
    corners = part.vertices[part.faces[shells.face]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    slope = normal / np.einsum("ij,ij->i", normal, ways.direction)[:, None]
    aside = errors(ways, field, *made)
    along = aside - np.einsum("kij,ij->ki", aside, slope)[..., None] * ways.direction
    return Found(engine.displacement * 1e3, shells.displacement * 1e3, along)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("field", choices=SOLVED)
    parser.add_argument("positions", nargs="+", metavar="X,Y,Z")
    parser.add_argument("--layers", type=int, default=13)
    parser.add_argument("--rule", choices=("midpoint", "graded"), default="midpoint")
    given = parser.parse_args()
    ensure(None)
    table = Table(title=f"{given.field}, {given.layers} shells: median / p95 of the difference, %")
    for title in ("camera / mm", "traced", *REPLACED):
        table.add_column(title, justify="right")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        field, part = SOLVED[given.field].field(folder), SOLVED[given.field].part
        stack = contour_shells(field, given.layers, rule=given.rule)
        camera = camera_at((0.0, -160.0, 160.0))
        xml = write_scene(folder / "scene", part, stack, camera, paraview=False, field=field)
        scenes = [load_scene(xml), load_scene(xml, engine="continuous")]
        for text in given.positions:
            position = tuple(float(x) for x in text.split(","))
            found = found_from(field, part, scenes, position, (given.layers, given.rule))
            differences = [found.shells - found.engine]
            differences += [found.without(*exact) for exact in REPLACED.values()]
            shares = (found.share(difference) for difference in differences)
            table.add_row(text, *(f"{median:.1f} / {p95:.1f}" for median, p95 in shares))
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
