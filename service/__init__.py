"""Processes, messages, storage and the command line."""
