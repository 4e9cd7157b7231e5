"""What outlives a replica."""
