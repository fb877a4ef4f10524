"""A process's plumbing: logging, signals, threads, limits, files; knows no messages."""
