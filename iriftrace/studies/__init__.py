"""Parameter studies: what the number of rays, shells and triangles, smoothing and cells change.

Each study traces one camera's picture many times, compares the refracted hits or the times, and
writes a netCDF file. They repeat Section 4.1 of Kern et al. (2025) in our mode and in the paper's.
"""
