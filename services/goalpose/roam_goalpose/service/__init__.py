"""The service's application object, its jobs and its worker processes."""
