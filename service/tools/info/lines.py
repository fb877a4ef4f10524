"""What is known of a file as lines for a person."""

from typing import Any

from denseface.service.tools.info.inspection import Info

__all__ = ["as_lines"]

_MAX_LINE = 300
"""Characters of a value."""
_LEFT_OUT = {"path", "kind", "format", "bytes", "provenance"}
_UNITS = {"_mm": "mm", "_us": "us", "_um": "um", "_ms": "ms"}
_WORDS = {"generator": "made by", "captured_at": "captured at", "capture_id": "capture"}


def as_lines(info: Info) -> list[str]:
    """Give a title, and a line for each thing that is known; what is empty is left out."""
    rows = [(name, info[name]) for name in info if name not in _LEFT_OUT]
    rows += list(info.get("provenance", {}).items())
    shown = [(_WORDS.get(name, _named(name)), _value(name, value)) for name, value in rows
             if value not in (None, "", [], {})]
    width = max((len(name) for name, _ in shown), default=0)
    return [f"{info['path']}: {info['kind']} ({info['format']}), {_size(info['bytes'])}",
            *(f"  {name:<{width}}  {value}" for name, value in shown)]


def _named(name: str) -> str:
    for ending in _UNITS:
        name = name.removesuffix(ending)
    return name.replace("_", " ")


def _value(name: str, value: Any) -> str:
    unit = next((f" {unit}" for ending, unit in _UNITS.items() if name.endswith(ending)), "")
    if isinstance(value, bool):
        said = "yes" if value else "no"
    elif isinstance(value, list):
        numbers = all(isinstance(one, int | float) for one in value)
        said = (" x " if name in ("size_mm", "grid") else ", " if numbers else "; ").join(
            map(_number, value)) + unit
    elif name == "measured":
        said = f"{value:.1%} of the depth image"
    else:
        said = _number(value) + unit
    return said if len(said) <= _MAX_LINE else f"{said[:_MAX_LINE]}..."


def _number(value: Any) -> str:
    return f"{value:,}" if isinstance(value, int) else str(value)


def _size(count: int) -> str:
    size = float(count)
    for unit in ("bytes", "kB", "MB"):
        if size < 1000:
            return f"{size:.0f} {unit}" if unit == "bytes" or size >= 100 else f"{size:.1f} {unit}"
        size /= 1000
    return f"{size:.1f} GB"
