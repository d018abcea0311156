"""Accuracy of the tracer, as a page that is computed anew: ``python -m validation``."""
