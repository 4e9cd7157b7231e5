"""How good and how fast the services are: benchmarks, and the pictures to look at."""
