"""The page where visitors press and see their own face; a client of the hub like any other."""
