"""Files to values: the only room, beside the save functions, that reads paths.

Each reader takes the formats that it names and refuses all others; it computes nothing.
"""
