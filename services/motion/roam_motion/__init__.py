"""Motion: a character that walks up to a goal pose and settles into it, frame by frame."""
