"""What happens in a worker's process: frames are read, faces made and written, and recorded."""
