"""The messages as data: what they hold and how they are written on the wire."""
