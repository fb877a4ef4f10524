"""The subcommands that deal with a sensor alone, without a service."""
