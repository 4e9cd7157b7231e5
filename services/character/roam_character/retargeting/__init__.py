"""Poses and motions of our figure on a user's own character."""
