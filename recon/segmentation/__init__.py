"""Stage 3: the depth of the face alone, and the colours of its seeds."""
