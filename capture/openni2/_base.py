"""What recordings and live sensors share: a device, its streams, a calibration, frames."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import ChosenCalibration
from denseface.capture.doubts import doubts_of
from denseface.capture.errors import FrameError
from denseface.capture.frame import DepthMeaning, DepthRounding, FrameOrigin, RgbdFrame
from denseface.capture.openni2._calibration import Size, derive_calibration, fit
from denseface.capture.openni2._library import close_handle, open_sources
from denseface.capture.openni2._streams import COLOR, DEPTH, Streams
from denseface.capture.source import Source


class OpenNI2Source(Source):
    """An open device that gives frames."""

    frame_count: int | None = None
    _live: bool
    _device: Any = None
    _streams: Streams | None = None

    def __init__(self, uri: str, chosen: ChosenCalibration | None) -> None:
        self.uri = uri
        self._name = uri.rstrip(":")
        self._chosen = chosen
        self._registered = False
        self._fitted: tuple[tuple[Size, Size | None], ChosenCalibration] | None = None
        """The calibration of the modes in use, and their sizes."""

    def __del__(self) -> None:
        self.close()

    def close(self) -> None:
        """Stop the streams and close the device; harmless when repeated."""
        if self._streams is not None:
            self._streams.close()
            self._streams = None
        if self._device is not None:
            close_handle(self._device)
            self._device = None

    def _open_streams(self, device: Any) -> Streams:
        self._device = device
        open_sources.add(self)
        try:
            streams = self._streams = Streams(device, self._name, live=self._live)
        except BaseException:
            self.close()
            raise
        return streams

    def _meaning(self, streams: Streams) -> DepthMeaning:
        """Say what depths mean: PrimeSense's drivers cut the fraction off."""
        return DepthMeaning(streams.depth_unit_um, DepthRounding.CUT, streams.max_mm)

    def _make_frame(
        self, streams: Streams, depth: NDArray[np.uint16], color: NDArray[np.uint8] | None,
        stamps_us: tuple[int, int], origin: FrameOrigin,
    ) -> RgbdFrame:
        """Make a frame; `streams` may be closed, `stamps_us` are of depth and of colour."""
        calibration, chosen, assumed, said = self._calibration(streams)
        registered = (self._registered or streams.registered) if said is None else said
        notes = (*streams.notes, *origin.notes, *assumed,
                 *doubts_of(calibration, registered or color is None))
        if registered and color is not None and depth.shape != color.shape[:2]:
            calibration, registered = calibration.for_images(
                (depth.shape[1], depth.shape[0]), (color.shape[1], color.shape[0]), registered)
        try:
            frame = RgbdFrame(
                depth, color, *stamps_us, calibration, registered,
                calibration_origin=chosen,
                depth_meaning=self._meaning(streams),
                origin=replace(origin, notes=notes))
        except FrameError as error:
            raise FrameError(f"{self._name}: {error} (calibration: {chosen})") from error
        return self.prepared(frame)

    def _calibration(self, streams: Streams) -> ChosenCalibration:
        """Give the chosen calibration, or what the device says, for the modes that are sent."""
        depth = streams.size(DEPTH)
        color = streams.size(COLOR) if COLOR in streams.kinds else None
        if self._fitted is None or self._fitted[0] != (depth, color):
            if self._chosen is None:
                calibration, derivation = derive_calibration(streams.properties, depth, color)
                origin = "device" if self._live else "recording"
                chosen = ChosenCalibration(calibration, f"{origin}: {derivation}")
            else:
                chosen = fit(self._chosen, depth, color)
            self._fitted = (depth, color), chosen
        return self._fitted[1]
