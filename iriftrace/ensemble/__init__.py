"""Several fields of one part: the mean displacement can be corrected, its scatter cannot."""
