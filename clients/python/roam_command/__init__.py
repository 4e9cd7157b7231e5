"""The roam command."""
