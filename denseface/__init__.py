"""The public face: what other programs import; docs/python.md shows it by what people do.

Everything is imported when first used, so that `import denseface` costs nothing.
"""

TYPE_CHECKING = False
"""As that of `typing`, whose import takes longer than all that is here."""

if TYPE_CHECKING:
    from denseface.capture.burst import fuse
    from denseface.capture.calibration import Calibration, CameraModel, DepthToColor
    from denseface.capture.calibration_files import load_calibration
    from denseface.capture.errors import (
        CalibrationError,
        CaptureError,
        DriverError,
        FrameError,
        MismatchedFrameError,
        SensorError,
        SensorTimeoutError,
        UnreadableSourceError,
        WrongSizeError,
    )
    from denseface.capture.frame import DepthMeaning, DepthRounding, FrameOrigin, RgbdFrame
    from denseface.capture.npz import load_frame, save_frame
    from denseface.capture.source import Source, open_source
    from denseface.errors import DensefaceError, MissingPackageError
    from denseface.recon.errors import (
        CoarseDepthError,
        FaceWithoutDepthError,
        ImpossibleFrameError,
        ImpossibleSettingsError,
        NoDepthError,
        NoFaceError,
        ReconstructionError,
        TooLittleDepthError,
    )
    from denseface.recon.face import Consent, DenseCloud, Face, FaceCandidate, PointCloud, Report
    from denseface.recon.measurement import Length, Measurements, measure
    from denseface.recon.pipeline import reconstruct
    from denseface.recon.settings import Neighbors, Preset, Settings
    from denseface.recon.warmup import warm
    from denseface.service.client import (
        AsyncClient,
        AsyncOperator,
        Client,
        Operator,
        Published,
        PublishedFace,
        PublishedFailure,
        PublishedHint,
        PublishedPreview,
    )
    from denseface.service.errors import (
        AddressError,
        CaptureFailedError,
        ClientClosedError,
        ClientForkedError,
        ClientTimeoutError,
        FormatError,
        KeyFileError,
        KeyRefusedError,
        LocalProtocolError,
        PressRefusedError,
        ProtocolError,
        RemoteProtocolError,
        RequestFailedError,
        ServiceError,
        SettingsError,
        UnknownCaptureError,
        UsageError,
    )
    from denseface.service.export import ExportOptions, load_face, save_face
    from denseface.service.export.printing import Printing
    from denseface.service.export.refusal import draw_refusal
    from denseface.service.export.render import render
    from denseface.service.protocol.message_base import CaptureSummary, DeadLetter
    from denseface.service.protocol.status import Status

    __version__: str

__all__ = [
    "AddressError", "AsyncClient", "AsyncOperator", "Calibration", "CalibrationError",
    "CameraModel", "CaptureError", "CaptureFailedError", "CaptureSummary", "Client",
    "ClientClosedError", "ClientForkedError", "ClientTimeoutError", "CoarseDepthError", "Consent",
    "DeadLetter", "DenseCloud", "DensefaceError", "DepthMeaning", "DepthRounding", "DepthToColor",
    "DriverError", "ExportOptions", "Face", "FaceCandidate", "FaceWithoutDepthError", "FormatError",
    "FrameError", "FrameOrigin", "ImpossibleFrameError", "ImpossibleSettingsError", "KeyFileError",
    "KeyRefusedError", "Length", "LocalProtocolError", "Measurements", "MismatchedFrameError",
    "MissingPackageError", "Neighbors", "NoDepthError", "NoFaceError", "Operator", "PointCloud",
    "Preset", "PressRefusedError", "Printing", "ProtocolError", "Published", "PublishedFace",
    "PublishedFailure", "PublishedHint", "PublishedPreview", "ReconstructionError",
    "RemoteProtocolError", "Report", "RequestFailedError", "RgbdFrame", "SensorError",
    "SensorTimeoutError", "ServiceError", "Settings", "SettingsError", "Source", "Status",
    "TooLittleDepthError", "UnknownCaptureError", "UnreadableSourceError", "UsageError",
    "WrongSizeError", "__version__", "draw_refusal", "fuse", "load_calibration", "load_face",
    "load_frame", "measure", "open_source", "reconstruct", "render", "save_face", "save_frame",
    "warm",
]

_NAMES = {
    "capture.burst": "fuse",
    "capture.calibration": "Calibration CameraModel DepthToColor",
    "capture.calibration_files": "load_calibration",
    "capture.errors": "CalibrationError CaptureError DriverError FrameError MismatchedFrameError "
                      "SensorError SensorTimeoutError UnreadableSourceError WrongSizeError",
    "capture.frame": "DepthMeaning DepthRounding FrameOrigin RgbdFrame",
    "capture.npz": "load_frame save_frame",
    "capture.source": "Source open_source",
    "errors": "DensefaceError MissingPackageError",
    "recon.errors": "CoarseDepthError FaceWithoutDepthError ImpossibleFrameError "
                    "ImpossibleSettingsError NoDepthError NoFaceError ReconstructionError "
                    "TooLittleDepthError",
    "recon.face": "Consent DenseCloud Face FaceCandidate PointCloud Report",
    "recon.measurement": "Length Measurements measure",
    "recon.pipeline": "reconstruct",
    "recon.settings": "Neighbors Preset Settings",
    "recon.warmup": "warm",
    "service.client": "AsyncClient AsyncOperator Client Operator Published PublishedFace "
                      "PublishedFailure PublishedHint PublishedPreview",
    "service.errors": "AddressError CaptureFailedError ClientClosedError ClientForkedError "
                      "ClientTimeoutError FormatError KeyFileError KeyRefusedError "
                      "LocalProtocolError PressRefusedError ProtocolError RemoteProtocolError "
                      "RequestFailedError ServiceError SettingsError UnknownCaptureError "
                      "UsageError",
    "service.export": "ExportOptions load_face save_face",
    "service.export.printing": "Printing",
    "service.export.refusal": "draw_refusal",
    "service.export.render": "render",
    "service.protocol.message_base": "CaptureSummary DeadLetter",
    "service.protocol.status": "Status",
}
"""Module -> public names that it has. The imports above say the same to type checkers, and
`__all__` to `import *`; a test holds the three together."""
_MODULES = {name: module for module, names in _NAMES.items() for name in names.split()}


def __getattr__(name: str) -> object:
    if name == "__version__":
        from denseface.version import VERSION

        value: object = VERSION
    elif name in _MODULES:
        from importlib import import_module

        from denseface.missing import explained

        with explained():
            value = getattr(import_module(f"denseface.{_MODULES[name]}"), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
