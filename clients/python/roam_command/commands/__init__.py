"""One module for every command of `roam`."""
