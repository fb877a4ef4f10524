"""ZeroMQ sockets: where the hub listens, and how the others connect.

Import from its modules: a client has no need of what listens.
"""
