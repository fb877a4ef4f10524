"""The processes of the service, one file each; a process imports its own file alone."""
