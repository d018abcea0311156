"""The measured part: a closed triangle surface with named regions.

Read from any mesh file (`read_part`), made from arrays (`part_of_mesh`) or from dimensions
(`standards`, `board`), and written with its regions (`save_part`).
"""
