"""File formats of poses and motions: one file per format."""
