"""`roam batch`: goal poses on every furniture file of a folder."""
