"""The gRPC side of a server: its options, its interceptor, health and reflection."""
