"""Two faces of one person laid on each other: `denseface compare`."""
