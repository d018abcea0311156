"""Frozen values: each case records entries, in a folder of its own that is the current one."""

from file_cases import calibrations, clouds, fields, poses
from other_cases import flow, names, parts, studies
from tracing_cases import fit, render, scene, sweep, two_devices

CASES = (
    *(render, two_devices, fit, sweep, scene),
    *(fields, calibrations, poses, clouds, flow, parts, studies, names),
)
