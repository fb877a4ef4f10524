"""What a frame's quality means: hints for the person, and whether a press gets the frame."""
