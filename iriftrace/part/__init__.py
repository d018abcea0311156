"""The measured part, its files, regions and parametric shapes."""
