"""The figure that stands for a person: a clothed, skinned surface of our own, on any humanoid skeleton."""
