"""One frame, or every frame of many files and folders, to faces: `denseface reconstruct`."""
