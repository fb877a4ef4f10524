"""ZeroMQ sockets: where the hub listens, and how the others connect."""
