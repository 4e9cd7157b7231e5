"""The wire: HTTP, gRPC, and the mapping between messages and domain types."""
