"""Values that break parsers."""

from random import Random
from typing import Any

__all__ = ["RAW", "values"]

_MARK = "@raw@"
RAW = f'"{_MARK}"'.encode()
"""In a written header: the place of what `json` would not write."""

_LARGE = 5000
"""Characters of a value that is not repeated any more."""

_NUMBERS: tuple[Any, ...] = (
    0, -1, 1, 2, 255, 2**31 - 1, 2**31, 2**53 + 1, 2**63 - 1, 2**63, -2**63, -2**63 - 1, 2**64,
    10**30, 0.5, -0.0, 1e-320, 1e15, 1e308, -1e308, 700.0)
_LITERALS = (
    b"NaN", b"Infinity", b"-Infinity", b"1e999", b"-1e999", b"1e-999", b"01", b"+1", b".5", b"1.",
    b"0x10", b"1e15", b"True", b"nul", b"'a'", b"9" * 400, b"9" * 4299, b"9" * 4301, b"9" * 100_000,
    b"0." + b"3" * 50_000, b"1" + b"0" * 308 + b".0", b"[" * 300 + b"]" * 300, b"[" * 100_000,
    b'{"a":' * 190 + b"1" + b"}" * 190, b'{"a":' * 30_000, b'"\\ud800"', b'"\\udc00\\ud800"',
    b'"\\u0000"', b'"\xff\xfe"', b'"\xc0\xaf"', b'"\xed\xa0\x80"', b'"\x01"', b'"\\x41"', b"",
    b"/**/1", b"1,", b"[1,]", b'{"a":1,"a":2}', b"[" + b"{}," * 20_000 + b"{}]",
    b"[" + b"0," * 30_000 + b"0]",
    b"{" + b",".join(b'"%x":1e15' % number for number in range(4_000)) + b"}",
    b"{" + b",".join(b'"%x":""' % number for number in range(20_000)) + b"}")
_TEXTS = (
    "", "a", "a\n", "../a", "a/b", ".", "\0", "\u202e", "\ud800", "e\u0301" * 50,
    "\U0001f600" * 9, "\u0130", "ss", "\u00df", "NaN", "1", "true",
    "<u2", "|u1", "<f8", "|O", "<U9", "V8",
    ">u2", "best", "0" * 64, "A" * 64, "A" * 65, "\x1b[2J", "%s%n", "{0}",
    "x" * 4000, "x" * 4001,
    "\U0001f600" * 4000, "y" * 200_000, "2026-01-01T00:00:00Z", "0001-01-01T00:00:00+23:59",
    "9999-12-31T23:59:59-23:59", "1", "-62135596800", "1e300", "P1D")
_TREES: tuple[Any, ...] = (None, True, False, [], {}, [[]], [None], {"": 1}, {"a": {}}, [1, 2, 3])


def values(rng: Random, present: Any) -> tuple[Any, bytes]:
    """Give a value to stand in for the present one, and the bytes for `RAW` where it is that."""
    return _values(rng, present) if len(repr(present)) < _LARGE else ("", b"")


def _values(rng: Random, present: Any) -> tuple[Any, bytes]:
    match rng.randrange(6):
        case 0:
            return _MARK, rng.choice(_LITERALS)
        case 1:
            return rng.choice(_TEXTS), b""
        case 2:
            return rng.choice(_TREES), b""
        case 3 if isinstance(present, int | float) and abs(present) < 2**64:
            return present + rng.choice((-1, 1, 0.5, 1e9)), b""
        case 4 if isinstance(present, str) and present:
            return present * rng.choice((2, 20)), b""
        case 5:
            return [present] * rng.choice((1, 2, 16, 17, 500)), b""
        case _:
            return rng.choice(_NUMBERS), b""
