"""The measured part: a closed triangle surface with named regions.

Made from arrays (`part_of_mesh`) or from dimensions (`standards`, `board`), cold or with its
thermal growth. `io` reads and writes the files.
"""
