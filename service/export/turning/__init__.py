"""A face that turns to and fro, without end: as an animated picture and as a video."""
