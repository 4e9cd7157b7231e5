"""The version of this release: the client, the command and the services share one."""

__version__ = "0.2.0"
