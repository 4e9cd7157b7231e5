"""Motion sessions: how one begins, what it is told, and both kinds of session."""
