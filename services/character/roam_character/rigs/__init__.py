"""A user's own character: reading its file, and telling which of its joints is which humanoid bone."""
