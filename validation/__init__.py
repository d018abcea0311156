"""How right the tracer is, as a page that is computed anew: ``python -m validation``."""
