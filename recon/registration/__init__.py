"""Stage 1: every depth pixel as a 3D point, and where the colour camera sees it."""
