"""Kernels of the tracer: marching, refraction, bending, ray queries and their tables."""
