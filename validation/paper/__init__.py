"""Parameter studies: effects of the number of rays, shells and triangles, smoothing and cells.

Each study varies one attribute of a scene (`kinds`), in our mode and in the paper's (`mode`), and
stores a table in a netCDF file (`study`). They repeat Section 4.1 of Kern et al. (2025).
"""
