"""Frame to face: pure functions on arrays."""
