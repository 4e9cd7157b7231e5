"""One module for every activity of which people's ranges are known."""
