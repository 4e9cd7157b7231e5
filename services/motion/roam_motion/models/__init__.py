"""Motion models, one package each."""
