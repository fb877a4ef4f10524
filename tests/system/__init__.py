"""Tests with real processes, the real OpenNI2 library and real sockets."""
