"""Processes, messages, storage, command line."""
