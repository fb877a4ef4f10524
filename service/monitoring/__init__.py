"""Counts, times and health, and how they are shown."""
