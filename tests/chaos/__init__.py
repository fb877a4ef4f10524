"""Crash harness: real processes that fail on purpose, and a checker of what came of it."""
