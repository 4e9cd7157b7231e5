"""Training of the descriptor field. Nothing that serves imports this."""
