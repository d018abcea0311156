"""Files to values: the only room, beside the save functions, that reads paths."""
