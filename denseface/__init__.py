"""The public face: what other programs import.

Everything is imported when first used, so that `import denseface` costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from denseface.capture import RgbdFrame, open_source
    from denseface.recon import Face, Settings, reconstruct
    from denseface.recon.face import Consent
    from denseface.service.client import AsyncClient, Client
    from denseface.service.export import load_face, save_face

    __version__: str

__all__ = [
    "AsyncClient", "Client", "Consent", "Face", "RgbdFrame", "Settings", "__version__", "load_face",
    "open_source", "reconstruct", "save_face",
]

_MODULES = {
    "AsyncClient": "denseface.service.client",
    "Client": "denseface.service.client",
    "Consent": "denseface.recon.face",
    "Face": "denseface.recon",
    "RgbdFrame": "denseface.capture",
    "Settings": "denseface.recon",
    "load_face": "denseface.service.export",
    "open_source": "denseface.capture",
    "reconstruct": "denseface.recon",
    "save_face": "denseface.service.export",
}
"""Module of each public name."""


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        value: Any = version("denseface")
    elif name in _MODULES:
        value = getattr(import_module(_MODULES[name]), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
