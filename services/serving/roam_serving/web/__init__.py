"""What only HTTP needs of a server: its port, and access as a middleware."""
