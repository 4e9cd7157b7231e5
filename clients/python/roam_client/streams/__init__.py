"""Frame streams: what one remembers to be resumed, and both kinds of stream."""
