"""Stages 4 and 5: the mean spacing of the seeds, and the RBF fit over them."""
