"""Compiled code: made by one process at a time, which says so, and kept where that is safe."""
