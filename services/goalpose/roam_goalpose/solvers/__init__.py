"""Ways to minimise the energy."""
