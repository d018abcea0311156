"""A STEP file of a block with a bore, written entity by entity."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

SIDES_MM, RADIUS_MM = (40.0, 30.0, 20.0), 7.5
"""Extents of the block, centred at the origin, and radius of its bore along z."""

_UNITS = {
    "mm": "(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))",
    "m": "(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT($,.METRE.))",
}
_HEADER = """\
ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('block','2025-01-01T00:00:00',(''),(''),'','','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));
ENDSEC;
DATA;
"""


class _Entities:
    """Lines of a STEP file; each call adds one and returns its number as ``#n``."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def __call__(self, text: str) -> str:
        self.lines.append(f"#{len(self.lines) + 1}={text};")
        return f"#{len(self.lines)}"

    def point(self, place: Sequence[float]) -> str:
        return self(f"CARTESIAN_POINT('',({','.join(f'{x:.9f}' for x in place)}))")

    def direction(self, vector: Sequence[float]) -> str:
        return self(f"DIRECTION('',({','.join(f'{x:.9f}' for x in vector)}))")

    def axes(self, place: Sequence[float], z: Sequence[float], x: Sequence[float]) -> str:
        where = self.point(place), self.direction(z), self.direction(x)
        return self(f"AXIS2_PLACEMENT_3D('',{','.join(where)})")

    def vertex(self, place: Sequence[float]) -> str:
        return self(f"VERTEX_POINT('',{self.point(place)})")

    def line(self, first: Sequence[float], vector: Sequence[float]) -> str:
        along = self(f"VECTOR('',{self.direction(vector)},1.)")
        return self(f"LINE('',{self.point(first)},{along})")

    def loop(self, edges: Sequence[tuple[str, bool]]) -> str:
        oriented = [self(f"ORIENTED_EDGE('',*,*,{e},{_flag(same)})") for e, same in edges]
        return self(f"EDGE_LOOP('',({','.join(oriented)}))")


def _flag(value: bool) -> str:
    return ".T." if value else ".F."


def bored_block(unit: str = "mm") -> str:
    """Text of a STEP file of the block, its lengths in that unit."""
    scale = {"mm": 1.0, "m": 1e-3}[unit]
    add = _Entities()
    half = [0.5 * scale * side for side in SIDES_MM]
    radius = RADIUS_MM * scale
    corners = {
        (i, j, k): (i * half[0], j * half[1], k * half[2])
        for i in (-1, 1)
        for j in (-1, 1)
        for k in (-1, 1)
    }
    vertices = {key: add.vertex(place) for key, place in corners.items()}
    edges = {}
    for axis in range(3):
        vector = [float(axis == a) for a in range(3)]
        for low in [key for key in corners if key[axis] == -1]:
            high = (*low[:axis], 1, *low[axis + 1 :])
            curve = add.line(corners[low], vector)
            ends = f"{vertices[low]},{vertices[high]}"
            edges[low, high] = add(f"EDGE_CURVE('',{ends},{curve},.T.)")
    # The bore's wall has two halves, as most CAD programs write it.
    rims, ends = {}, {}
    for k in (-1, 1):
        ends[k] = [add.vertex((x, 0.0, k * half[2])) for x in (radius, -radius)]
        centre = (0.0, 0.0, k * half[2])
        circle = add(f"CIRCLE('',{add.axes(centre, (0, 0, 1), (1, 0, 0))},{radius:.9f})")
        rims[k] = [
            add(f"EDGE_CURVE('',{first},{second},{circle},.T.)")
            for first, second in (ends[k], ends[k][::-1])
        ]
    seams = []
    for number, x in enumerate((radius, -radius)):
        upward = add.line((x, 0.0, -half[2]), (0.0, 0.0, 1.0))
        seams.append(add(f"EDGE_CURVE('',{ends[-1][number]},{ends[1][number]},{upward},.T.)"))
    faces = []
    for axis in range(3):
        for side in (-1, 1):
            normal = [float(side) if axis == a else 0.0 for a in range(3)]
            across = [1.0 if a == (axis + 1) % 3 else 0.0 for a in range(3)]
            # Counter-clockwise as seen from outside.
            turns = [(-1, -1), (1, -1), (1, 1), (-1, 1)][::side]
            keys = [tuple(np.roll((side, u, v), axis).tolist()) for u, v in turns]
            around = []
            for first, second in zip(keys, [*keys[1:], keys[0]], strict=True):
                same = (first, second) in edges
                around.append((edges[(first, second) if same else (second, first)], same))
            bounds = [add(f"FACE_OUTER_BOUND('',{add.loop(around)},.T.)")]
            if axis == 2:
                rim = [(edge, side < 0) for edge in rims[side][::-side]]
                bounds.append(add(f"FACE_BOUND('',{add.loop(rim)},.T.)"))
            place = [side * half[axis] if axis == a else 0.0 for a in range(3)]
            plane = add(f"PLANE('',{add.axes(place, normal, across)})")
            faces.append(add(f"ADVANCED_FACE('',({','.join(bounds)}),{plane},.T.)"))
    for number in range(2):
        up, down = seams[1 - number], seams[number]
        wall = [(rims[-1][number], True), (up, True), (rims[1][number], False), (down, False)]
        bound = add(f"FACE_OUTER_BOUND('',{add.loop(wall)},.F.)")
        axes = add.axes((0, 0, 0), (0, 0, 1), (1, 0, 0))
        bore = add(f"CYLINDRICAL_SURFACE('',{axes},{radius:.9f})")
        faces.append(add(f"ADVANCED_FACE('',({bound}),{bore},.F.)"))
    shell = add(f"CLOSED_SHELL('',({','.join(faces)}))")
    solid = add(f"MANIFOLD_SOLID_BREP('block',{shell})")
    length = add(_UNITS[unit])
    angle = add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
    solid_angle = add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")
    tolerance = f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE({1e-7 * scale:.10f}),{length},'','')"
    context = add(
        f"(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({add(tolerance)}))"
        f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle},{solid_angle}))REPRESENTATION_CONTEXT('',''))"
    )
    axes = add.axes((0, 0, 0), (0, 0, 1), (1, 0, 0))
    shape = add(f"ADVANCED_BREP_SHAPE_REPRESENTATION('',({axes},{solid}),{context})")
    application = add("APPLICATION_CONTEXT('automotive design')")
    product_context = add(f"PRODUCT_CONTEXT('',{application},'mechanical')")
    product = add(f"PRODUCT('block','block','',({product_context}))")
    formation = add(f"PRODUCT_DEFINITION_FORMATION('','',{product})")
    design = add(f"PRODUCT_DEFINITION_CONTEXT('part definition',{application},'design')")
    definition = add(f"PRODUCT_DEFINITION('design','',{formation},{design})")
    defined = add(f"PRODUCT_DEFINITION_SHAPE('','',{definition})")
    add(f"SHAPE_DEFINITION_REPRESENTATION({defined},{shape})")
    return _HEADER + "\n".join(add.lines) + "\nENDSEC;\nEND-ISO-10303-21;\n"
