"""Users' own characters: mapping, round trip, contacts."""
