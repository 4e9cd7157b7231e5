"""The wire: HTTP, gRPC, WebSocket, and the mapping between messages and domain types."""
