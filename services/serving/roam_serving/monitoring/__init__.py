"""Logs, metrics, traces, and whether a server is ready."""
