"""Commands about files: say what one is, write a face in another format."""
