"""Planning: the best poses of a sweep, and how certain they are.

From a sweep to a ranking by one score of four metrics, its stability and Pareto front, sets of
views that together see the most, and a search around the best pose.
"""
