"""The optics of the tracer, from equation to kernel.

Light follows d/ds (n dr/ds) = grad n. Read in this order:

- `snell`: a jump of n at one surface. Along its normal, n d gains what Snell's law asks for.
- `layers`: the turn between two shells, the integral of the transverse gradient along the path.
- `march`: from shell to shell, with exact points on the triangles that `queries` finds.
- `curve`, `walk`, `nystrom` and `tetrahedra`: the equation itself, step by step through the
  solver's own cells.
- `edges`: hits within a float32 spacing of an edge, put on the face that is met.
- `ledger`: the conserved sum of index steps, by which lost crossings are noticed.
- `bundle`: straight and bent hits joined, and each ray's status.
- `projection`: pixels to rays and points to pixels.
- `tables` and `prepared`: all of a scene that these gather from.
- `types`: names of Dr.Jit's arrays for annotations.

Directions and points are float64; single precision only says which triangle is met.
"""
