"""A block of typed words that two processes share: the base of the control channel.

Every field has the size of a whole number of 8-byte words, so a read or a write of a number is one
access and never torn. The same table gives the struct that the driver is compiled with.
"""

import enum
import struct
from collections.abc import Iterator
from typing import Any, Generic, Self, TypeVar, overload

__all__ = ["Block", "Choice", "Count", "Field", "Flag", "Number", "Real", "Text"]

T = TypeVar("T")
E = TypeVar("E", bound=enum.IntEnum | enum.IntFlag)
_WORD = 8
"""Bytes."""


class Field(Generic[T]):
    """One named, typed value of a `Block`."""

    size = _WORD

    def __init__(self, default: T) -> None:
        self.default = default
        self.name = ""
        self.offset = 0

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, block: None, owner: type) -> Self: ...
    @overload
    def __get__(self, block: "Block", owner: type) -> T: ...
    def __get__(self, block: "Block | None", owner: type) -> "T | Self":
        if block is None:
            return self
        at = block.at + self.offset
        return self.decode(bytes(block.memory[at:at + self.size]))

    def __set__(self, block: "Block", value: T) -> None:
        at = block.at + self.offset
        block.memory[at:at + self.size] = self.encode(value)

    def encode(self, value: T) -> bytes:
        """Give the bytes of a value."""
        raise NotImplementedError

    def decode(self, data: bytes) -> T:
        """Give the value of bytes."""
        raise NotImplementedError

    def declaration(self) -> str:
        """Give the member of the driver's struct."""
        raise NotImplementedError


class Number(Field[int]):
    """A whole number."""

    def __init__(self, default: int = 0) -> None:
        super().__init__(default)

    def encode(self, value: int) -> bytes:
        return struct.pack("<q", value)

    def decode(self, data: bytes) -> int:
        return int(struct.unpack("<q", data)[0])

    def declaration(self) -> str:
        return f"std::atomic<int64_t> {self.name}{{{int(self.default)}}};"


class Count(Number):
    """A number that the driver writes and the tests only read."""


class Flag(Field[bool]):
    """Yes or no."""

    def __init__(self, default: bool = False) -> None:
        super().__init__(default)

    def encode(self, value: bool) -> bytes:
        return struct.pack("<q", bool(value))

    def decode(self, data: bytes) -> bool:
        return data != bytes(_WORD)

    def declaration(self) -> str:
        return f"std::atomic<int64_t> {self.name}{{{int(self.default)}}};"


class Choice(Field[E]):
    """One of an enumeration, or some of its flags."""

    def __init__(self, default: E) -> None:
        super().__init__(default)
        self.kind = type(default)

    def encode(self, value: E) -> bytes:
        return struct.pack("<q", self.kind(value))

    def decode(self, data: bytes) -> E:
        return self.kind(struct.unpack("<q", data)[0])

    def declaration(self) -> str:
        return f"std::atomic<int64_t> {self.name}{{{int(self.default)}}};"


class Real(Field[float]):
    """A number with a fraction."""

    def __init__(self, default: float = 0.0) -> None:
        super().__init__(default)

    def encode(self, value: float) -> bytes:
        return struct.pack("<d", value)

    def decode(self, data: bytes) -> float:
        return float(struct.unpack("<d", data)[0])

    def declaration(self) -> str:
        return f"std::atomic<double> {self.name}{{{float(self.default)!r}}};"


class Text(Field[str]):
    """UTF-8, ended by a zero byte. Not written in one access: the driver reads it on events."""

    def __init__(self, default: str = "", *, size: int = 64) -> None:
        super().__init__(default)
        self.size = size

    def encode(self, value: str) -> bytes:
        data = value.encode()
        if len(data) >= self.size:
            raise ValueError(f"{self.name} may have {self.size - 1} bytes, got {value!r}")
        return data.ljust(self.size, b"\0")

    def decode(self, data: bytes) -> str:
        return data.split(b"\0", 1)[0].decode()

    def declaration(self) -> str:
        return f'char {self.name}[{self.size}] = "{self.default}";'


class Block:
    """Fields in memory that is shared, in the order in which they are written in the class.

    Parameters
    ----------
    memory : writable, at least `at + SIZE` bytes
    at : where the block begins, bytes
    """

    FIELDS: dict[str, Field[Any]]
    SIZE: int

    def __init_subclass__(cls) -> None:
        cls.FIELDS = {name: field for name, field in vars(cls).items() if isinstance(field, Field)}
        cls.SIZE = 0
        for field in cls.FIELDS.values():
            field.offset = cls.SIZE
            cls.SIZE += field.size

    def __init__(self, memory: Any, at: int = 0) -> None:
        self.memory = memory
        self.at = at

    def reset(self) -> None:
        """Write every field's default."""
        for name, field in self.FIELDS.items():
            setattr(self, name, field.default)

    def update(self, values: dict[str, Any]) -> None:
        """Write fields by name."""
        for name, value in values.items():
            if name not in self.FIELDS:
                raise AttributeError(f"{type(self).__name__} has no field {name!r}")
            setattr(self, name, value)

    @classmethod
    def struct(cls, name: str) -> Iterator[str]:
        """Give the lines of the driver's struct."""
        yield f"struct {name} {{"
        for field in cls.FIELDS.values():
            yield f"    {field.declaration()}"
        yield "};"
        yield f"static_assert(sizeof({name}) == {cls.SIZE});"
