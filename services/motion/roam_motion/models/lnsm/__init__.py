"""l-NSM (paper 3.2)."""
