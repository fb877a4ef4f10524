"""Archives: thousands of frames to faces on many cores or machines, and a row for each frame."""
