"""Training of the motion network: recordings, labels, episodes, roll-outs. Nothing that serves imports this."""
