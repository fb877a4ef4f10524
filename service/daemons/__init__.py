"""The processes of the service, one file each; no re-exports, for each imports its own alone."""
