"""A physical button, read past the browser: as Linux's input devices give it (evdev)."""
