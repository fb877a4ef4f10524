"""Files that are served: those that were there at the start, by their whole names."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

__all__ = ["Files"]

_TYPES = {
    ".css": "text/css; charset=utf-8", ".face": "application/octet-stream",
    ".html": "text/html; charset=utf-8", ".ico": "image/x-icon",
    ".js": "text/javascript; charset=utf-8", ".json": "application/json", ".png": "image/png",
    ".svg": "image/svg+xml", ".txt": "text/plain; charset=utf-8", ".webp": "image/webp",
    ".woff2": "font/woff2"}
"""What is served; a file of another ending is not."""
_MAX_BYTES = 16 * 2**20
"""Largest file that is served."""


@dataclass(frozen=True)
class _File:
    content: bytes
    kind: str
    tag: str


class Files:
    """The files of folders, read once. No name from outside ever becomes a path.

    Parameters
    ----------
    folders : prefix of the names, such as `static/`, and the folder; one that is missing is empty
    """

    def __init__(self, folders: dict[str, Path]) -> None:
        self._files = {
            prefix + path.relative_to(folder).as_posix(): _read(path)
            for prefix, folder in folders.items() for path in sorted(folder.rglob("*"))
            if path.suffix in _TYPES and path.is_file() and path.stat().st_size <= _MAX_BYTES}

    @property
    def digest(self) -> str:
        """Another one where any of the files is another."""
        tags = "".join(f"{name}{file.tag}" for name, file in sorted(self._files.items()))
        return hashlib.sha256(tags.encode()).hexdigest()

    def __contains__(self, name: str) -> bool:
        return name in self._files

    def answer(self, name: str, request: Request) -> Response:
        """Give the file of a name, 304 where the browser has it, or 404."""
        file = self._files.get(name)
        if file is None:
            return PlainTextResponse("there is no such file\n", 404)
        # Asked again each time: the next version of the service has another page.
        headers = {"etag": file.tag, "cache-control": "no-cache"}
        known = request.headers.get("if-none-match", "")
        if file.tag in (tag.strip().removeprefix("W/") for tag in known.split(",")):
            return Response(status_code=304, headers=headers)
        return Response(file.content, media_type=file.kind, headers=headers)


def _read(path: Path) -> _File:
    content = path.read_bytes()
    return _File(content, _TYPES[path.suffix], f'"{hashlib.sha256(content).hexdigest()[:32]}"')
