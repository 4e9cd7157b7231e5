"""Reference pairs of a pose and an object."""
