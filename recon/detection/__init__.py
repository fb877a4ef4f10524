"""Stage 2: the face in the colour image, confirmed by its depth."""
