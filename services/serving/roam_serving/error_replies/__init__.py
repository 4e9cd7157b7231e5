"""Rows of the error table as each transport tells them: HTTP, gRPC and WebSocket."""
