"""Parameter studies: what the number of rays, shells and triangles, smoothing and cells change.

Each study varies one attribute of a scene (`kinds`), in our mode and in the paper's (`mode`), and
keeps a table in a netCDF file (`study`). They repeat Section 4.1 of Kern et al. (2025).
"""
