"""The hot air: index of refraction at points, its gradient, and shells of equal index.

NumPy and VTK only; values in, values out. Files are read in `io`, rays are traced in `tracing`.
"""
