"""Sweeps: many poses of a camera in one result.

Poses of one scene or several are rendered here or by workers on other machines. A sweep that was
killed continues where it stopped. The result is one netCDF file.
"""
