"""Planning: the poses of a sweep that are best, and how sure that is.

From a sweep to a ranking by one score of four metrics, its stability and Pareto front, sets of
views that together see the most, and a search around the best pose.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
