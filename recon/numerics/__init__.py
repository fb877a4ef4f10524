"""Numerical tools that know no faces; import the one that is needed."""
