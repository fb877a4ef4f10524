"""Stage 6: the dense cloud, its colours and its standard error."""
