"""What runs the tasks of a batch: behind three calls, Dask on this machine or on many."""
