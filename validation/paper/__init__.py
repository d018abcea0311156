"""The paper's parameter studies: numbers of rays, shells and triangles, smoothing, and cells.

Each study varies one attribute of a scene (`kinds`), in our mode and in the paper's (`mode`), and
stores a table in a netCDF file (`study`): ``python -m validation.paper layers field.vtu part.ply``.
They repeat Section 4.1 of Kern et al. (2025).
"""
