"""What the hub decides: messages and the time in, messages out; no sockets, clock or disk."""
