"""From what a caller intends to what the network is asked for."""
