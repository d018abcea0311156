"""Triangle surfaces: rigid motions, topology, nearest points."""
