"""Faces to files and pictures."""
