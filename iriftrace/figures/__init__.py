"""Figures: pictures of poses, scenes, sweeps, studies and comparisons, and the HTML report.

Functions take results and return Matplotlib figures; ``write_figure`` writes them as PNG or PDF.
Nothing is computed here that a result does not hold already.
"""
