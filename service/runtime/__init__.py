"""A process's plumbing: terminals, signals, threads, files, limits.

Imported by module: what only parses a setting needs no logging.
"""
