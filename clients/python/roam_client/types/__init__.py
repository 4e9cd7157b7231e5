"""What the services answer and are asked for, as Python objects."""
