"""Motion models: what predicts the next frame. One folder each, behind a key in the weights file; see registry.py."""
