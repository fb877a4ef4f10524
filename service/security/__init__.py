"""Keys, the allow-list, and which role may say what."""
