"""The subcommands that set one surface beside another: two faces, or a face and the truth."""
