"""A live RGB-D sensor for tests: frames from a file through the real OpenNI2 library."""
