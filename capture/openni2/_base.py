"""What recordings and live sensors share: a device, its streams, a calibration, pairs."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import ChosenCalibration
from denseface.capture.errors import FrameError, SensorError
from denseface.capture.frame import DepthMeaning, DepthRounding, FrameOrigin, RgbdFrame
from denseface.capture.openni2._calibration import derive_calibration
from denseface.capture.openni2._library import close_handle, open_sources
from denseface.capture.openni2._streams import COLOR, DEPTH, Image, Streams
from denseface.capture.pairing import Pair, Pairer
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
        self.pairer: Pairer[Any, Any] = Pairer()
        self._chosen = chosen
        self._registered = False
        self._unit_um = 1000

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
            self._unit_um = streams.depth_unit_um
            if self._chosen is None:
                calibration, derivation = derive_calibration(
                    streams.properties, streams.size(DEPTH), streams.size(COLOR))
                origin = "device" if self._live else "recording"
                self._chosen = ChosenCalibration(calibration, f"{origin}: {derivation}")
        except BaseException:
            self.close()
            raise
        return streams

    def _add(self, kind: str, image: Image) -> Pair[Any, Any] | None:
        return (self.pairer.add_depth if kind == DEPTH else self.pairer.add_color)(*image)

    def _frame(self, pair: Pair[Any, Any]) -> RgbdFrame:
        return self._make_frame(pair.depth, pair.color, (pair.depth_us, pair.color_us),
                                FrameOrigin())

    def _make_frame(
        self, depth: NDArray[np.uint16], color: NDArray[np.uint8] | None,
        stamps_us: tuple[int, int], origin: FrameOrigin,
    ) -> RgbdFrame:
        """Make a frame; `stamps_us` are of depth and of colour."""
        if self._chosen is None:
            raise SensorError(f"{self._name}: is closed")
        calibration, chosen = self._chosen
        try:
            # PrimeSense's drivers, and the recordings made through them, cut the fraction off.
            return RgbdFrame(depth, color, *stamps_us, calibration, self._registered,
                             calibration_origin=chosen, origin=origin,
                             depth_meaning=DepthMeaning(self._unit_um, DepthRounding.CUT))
        except FrameError as error:
            raise FrameError(f"{self._name}: {error} (calibration: {chosen})") from error
