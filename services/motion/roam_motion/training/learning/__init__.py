"""Roll-outs, the loop that learns from them, and how good what was learnt is."""
