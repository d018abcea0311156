"""Figures: pictures of poses, scenes, sweeps and comparisons, and the HTML report.

Functions take results and return Matplotlib figures; ``write_figure`` writes them as PNG or PDF.
Everything shown is already part of a result; nothing is computed here.
"""
