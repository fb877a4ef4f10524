"""What can go wrong between a press and a published face.

Each error is also the builtin kind that a caller would expect to catch.
"""

import errno
import os
from typing import TYPE_CHECKING

from denseface.errors import DensefaceError
from denseface.validation import complaint

if TYPE_CHECKING:
    from pydantic import ValidationError

__all__ = [
    "AddressError", "AuthenticatorStoppedError", "CalibrationFailedError", "CaptureFailedError",
    "ClientClosedError", "ClientForkedError", "ClientTimeoutError", "CorruptFileError",
    "DamagedDatabaseError", "DamagedFaceError", "DiskFullError", "FormatError",
    "FrameTooLargeError", "HubRunningError", "KeyFileError", "KeyRefusedError",
    "LocalProtocolError", "PressRefusedError", "ProtocolError", "RemoteProtocolError",
    "RequestFailedError", "ServiceError", "SettingsError", "StoreError", "UnknownCaptureError",
    "UsageError", "first_error", "in_one_line", "is_full", "reason_of",
]


class ServiceError(DensefaceError):
    """Base of every error raised by `service`."""


class ProtocolError(ServiceError, ValueError):
    """A message is not as `service.protocol.wire` describes it."""


class LocalProtocolError(ProtocolError):
    """We tried to send a message that may not be sent."""


class RemoteProtocolError(ProtocolError):
    """The other side sent something that is no message: drop it.

    Attributes
    ----------
    reason : `malformed`, `oversized`, `truncated` or `version`
    request : number of the request that it would have answered; None where that is not known
    """

    request: int | None = None

    def __init__(self, message: str, reason: str = "malformed") -> None:
        super().__init__(message)
        self.reason = reason


class ClientClosedError(ServiceError, RuntimeError):
    """A call on a client that was closed."""


class ClientForkedError(ServiceError, RuntimeError):
    """A call in a process that was forked after the client was made."""


class ClientTimeoutError(ServiceError, TimeoutError):
    """The hub did not answer, or the face was not ready, in the time allowed."""


class PressRefusedError(ServiceError, RuntimeError):
    """The press led to no capture: no sensor, no frame in time or none that is good enough, ...

    Attributes
    ----------
    reason : `no_sensor`, `sensor`, `sensor_gone`, `quality`, `timeout`, `queue`, `disk` or `purged`
    codes : what was wrong with the last frame, where the reason is `quality`
    text : the first of these in words, for the person
    """

    def __init__(
        self, message: str, reason: str, codes: tuple[str, ...] = (), text: str = ""
    ) -> None:
        super().__init__(message)
        self.reason = reason
        self.codes = codes
        self.text = text


class CaptureFailedError(ServiceError, RuntimeError):
    """The capture was accepted and ended without a face.

    Attributes
    ----------
    capture_id : the capture
    error : name of the error that ended it, such as `NoFaceError`
    dead : given up after repeated attempts (a dead letter), rather than answered "no face"
    """

    def __init__(self, capture_id: str, error: str, message: str, *, dead: bool = False) -> None:
        super().__init__(f"capture {capture_id}: {message} ({error})")
        self.capture_id = capture_id
        self.error = error
        self.dead = dead


class RequestFailedError(ServiceError, RuntimeError):
    """The hub could not answer: it says why."""


class UnknownCaptureError(ServiceError, LookupError):
    """The hub has no capture of this id."""


class StoreError(ServiceError, OSError):
    """The data folder cannot be read or written."""


class DiskFullError(StoreError):
    """The disk is full."""


class CorruptFileError(StoreError):
    """A file of the data folder does not have the contents that its checksum states."""


class DamagedFaceError(CorruptFileError):
    """The file of a capture's face is damaged: the face must be computed again."""

    def __init__(self, capture_id: str, reason: str) -> None:
        super().__init__(reason)
        self.capture_id = capture_id


class DamagedDatabaseError(ServiceError, OSError):
    """The database is malformed: the hub ends, and the next one rebuilds it from the files."""


class SettingsError(ServiceError, ValueError):
    """A setting of the service is unknown or has an impossible value."""


class AddressError(SettingsError):
    """An address is malformed, or one that the hub may not bind."""


class KeyFileError(SettingsError):
    """A key file is missing, malformed, open to others, or its name is in use."""


class AuthenticatorStoppedError(ServiceError, RuntimeError):
    """The hub's authenticator stopped, and so must the hub."""


class KeyRefusedError(ServiceError, PermissionError):
    """The hub refuses this key."""


class HubRunningError(ServiceError, RuntimeError):
    """Another hub already serves this address or data folder."""


class FrameTooLargeError(ServiceError, ValueError):
    """A frame has more pixels than the setting allows."""


class CalibrationFailedError(ServiceError, RuntimeError):
    """The views of a board give no calibration."""


class FormatError(ServiceError, ValueError):
    """A file's ending names no known format, or its contents are not of that format."""


class UsageError(ServiceError, ValueError):
    """What is asked for does not exist, or is not to be had there."""


_REASONS = {
    errno.EISDIR: "is a folder, expected a file",
    errno.ENOTDIR: "lies in what is a file, expected a folder",
    errno.ENAMETOOLONG: "the name is too long",
}
"""What the system says in words that leave out what was expected."""


def first_error(error: "ValidationError", *, found: bool = False) -> tuple[str, str]:
    """Give the first field that pydantic refuses, its path with dots, and why, in one sentence.

    The field is empty where the whole is refused; `found` adds the value that it had.
    """
    first = error.errors(include_url=False)[0]
    return ".".join(map(str, first["loc"])), complaint(first, found=found)


def is_full(number: int | None) -> bool:
    """Say whether the system's number of an error is of a disk without room, or over its quota."""
    return number in (errno.ENOSPC, errno.EDQUOT)


def in_one_line(error: object) -> str:
    """Say what an error says, line breaks as spaces; its class where it says nothing."""
    return " ".join(str(error).split()) or type(error).__name__


def reason_of(error: BaseException) -> str:
    """Say what went wrong; of an error of the system without its number and file."""
    said = getattr(error, "strerror", None) or str(error)
    number = getattr(error, "errno", None)
    return _REASONS.get(number, said) if number and said == os.strerror(number) else said
