"""The log of a process: what is in a line, how many there may be, and where they go.

Imported by module: what only counts lost lines needs no structlog.
"""
