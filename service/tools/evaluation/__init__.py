"""Faces against a known true surface, in the tables of the paper: `denseface evaluate`."""
