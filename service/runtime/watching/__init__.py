"""What a process tells whoever watches it: the supervisor, and a service manager as systemd."""
