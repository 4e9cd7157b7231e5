"""Channels, retries and how arrays travel: what every call stands on."""
