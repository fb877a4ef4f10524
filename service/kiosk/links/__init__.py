"""Links by which a visitor fetches the face, and the LAN door, which serves them alone."""
