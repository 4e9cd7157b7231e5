"""Version 1 of the protocol; the messages and their bytes are described in `proto/README.md`."""
