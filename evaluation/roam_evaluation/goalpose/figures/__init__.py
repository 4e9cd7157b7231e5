"""Plots and sheets of goal poses."""
