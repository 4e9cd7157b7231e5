"""A rigid-body simulation of whether a goal pose carries the body."""
