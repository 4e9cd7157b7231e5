"""Studies of goal poses."""
