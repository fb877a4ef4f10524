"""systemd's units for a kiosk host: made for this installation, written, and removed again."""

from denseface.service.tools.units.installation import install, show, uninstall
from denseface.service.tools.units.rendering import Choice

__all__ = ["Choice", "install", "show", "uninstall"]
