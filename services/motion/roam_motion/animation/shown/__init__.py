"""What is added to frames as they are shown, and that the next step does not start from."""
