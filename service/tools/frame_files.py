"""All that may be written of one frame: the frame itself, and a photo."""

from dataclasses import dataclass
from pathlib import Path

from denseface.capture import RgbdFrame
from denseface.capture.npz import save_frame
from denseface.files import write_whole
from denseface.service.errors import StoreError, UsageError, reason_of
from denseface.service.export import check_outputs
from denseface.service.export.photo import to_photo
from denseface.service.export.written import describe_file

__all__ = ["FrameFiles"]


@dataclass(frozen=True)
class FrameFiles:
    """Where to write a frame; None is not written, and it is false where neither is.

    Raises
    ------
    UsageError, StoreError
        As `check_outputs`.
    """

    frame: Path | None = None
    """`.npz`"""
    photo: Path | None = None
    """`.png`, of the colour image"""
    mode: int | None = None
    """Of each file; None for 666 less the umask."""

    def __post_init__(self) -> None:
        check_outputs((self.frame, ".npz"), (self.photo, ".png"))

    def __bool__(self) -> bool:
        return bool(self.frame or self.photo)

    def write(self, frame: RgbdFrame) -> None:
        """Write all; each file is whole or not there.

        Raises
        ------
        StoreError
            Where a file cannot be written.
        UsageError
            Where a photo is asked for and the sensor has no colour camera.
        """
        if self.frame:
            try:
                save_frame(frame, self.frame, mode=self.mode)
            except OSError as error:
                raise StoreError(f"{self.frame}: {reason_of(error)}") from error
        if self.photo:
            if frame.color is None:
                raise UsageError(f"--photo {self.photo}: the sensor has no colour camera")
            try:
                write_whole(self.photo, [to_photo(frame)], mode=self.mode)
            except OSError as error:
                raise StoreError(f"{self.photo}: {reason_of(error)}") from error

    def describe(self, frame: RgbdFrame) -> list[str]:
        """Say of each file that was written what it is, a line each."""
        lines = []
        if self.frame:
            height, width = frame.depth.shape
            origin = frame.origin
            taken = f", taken {origin.captured_at}" if origin.captured_at else ""
            lines.append(f"{self.frame}: frame of {width}x{height}{taken}; `denseface reconstruct "
                         f"{self.frame}` makes a face of it, load_frame() reads it")
        if self.photo:
            height, width, _ = frame.rgb.shape
            lines.append(describe_file(self.photo, f"photo of {width}x{height}"))
        return lines
