"""Studies of motion."""
