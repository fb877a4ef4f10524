"""Work that needs no hub."""
