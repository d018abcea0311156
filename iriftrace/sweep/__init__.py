"""Sweeps: many poses of a camera in one result.

Poses of one scene or several are rendered here or by workers on other machines; a sweep that was
killed goes on where it stopped. The result is one netCDF file.
"""
