"""Studies of the running services."""
