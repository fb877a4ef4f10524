"""What a notebook or a debugger shows of a thing: one short line in place of its arrays."""

__all__ = ["short_repr"]

_MAX_PART, _MAX_PARTS = 48, 180
"""Characters of one part, and of all."""


def short_repr(thing: object, *parts: str) -> str:
    """Give `<Kind: part, part>`, one line of fewer than 200 characters; empty parts are left out.

    Parts come from files too: what is long is cut, what cannot be printed is escaped.
    """
    text = ", ".join(_cut(part, _MAX_PART) for part in parts if part)
    return f"<{type(thing).__name__}: {_cut(text, _MAX_PARTS - len(type(thing).__name__))}>"


def _cut(text: str, most: int) -> str:
    line = text if text.isprintable() else ascii(text)[1:-1]
    return line if len(line) <= most else f"{line[:most - 3]}..."
