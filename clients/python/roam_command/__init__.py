"""The `roam` command: poses, motions, servers, the demo page, training and evaluation from a shell.

One file per command; heavy packages are imported only by the command that needs them.
"""
