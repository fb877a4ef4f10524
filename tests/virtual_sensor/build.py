"""Build the virtual sensor: a private OpenNI2 folder with our own driver in it."""

import hashlib
import shutil
import subprocess
import tempfile
from pathlib import Path

from denseface.capture.openni2._library import find_library
from tests.virtual_sensor.control import layout_header

__all__ = ["build"]

_SOURCES = Path(__file__).with_name("driver")
_INCLUDE = Path("/usr/include/openni2")
_COMPILE = ["g++", "-std=c++17", "-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC",
            "-pthread"]


def build(folder: Path | None = None) -> Path:
    """Give the OpenNI2 folder of the virtual sensor; compile only where something changed.

    Parameters
    ----------
    folder : where it is kept between runs; `build/virtual_sensor` of the repository by default

    Raises
    ------
    SensorError
        Where the OpenNI2 library is missing.
    subprocess.CalledProcessError
        Where the compiler refuses.
    """
    library = find_library()
    drivers = library / "OpenNI2" / "Drivers"
    real = (library / "libOpenNI2.so").resolve()
    sources = b"".join(path.read_bytes() for path in sorted(_SOURCES.iterdir()))
    layout = layout_header().encode()
    key = hashlib.sha256(sources + layout + real.read_bytes()
                         + " ".join(_COMPILE).encode()).hexdigest()[:16]
    parent = folder or Path(__file__).resolve().parents[2] / "build" / "virtual_sensor"
    ready = parent / key
    if ready.is_dir():
        return ready
    parent.mkdir(parents=True, exist_ok=True)
    # Built aside and renamed: tests in parallel never see half a folder.
    with tempfile.TemporaryDirectory(dir=parent) as name:
        made = Path(name) / key
        private = made / "OpenNI2" / "Drivers"
        private.mkdir(parents=True)
        # OpenNI2 looks for drivers beside the file that was loaded, so a copy and not a link.
        shutil.copy(real, made / "libOpenNI2.so")
        shutil.copy((drivers / "libOniFile.so").resolve(), private / "libOniFile.so.0")
        (made / "control_layout.h").write_bytes(layout)
        subprocess.run([*_COMPILE, f"-I{_INCLUDE}", f"-I{made}", str(_SOURCES / "driver.cpp"), "-o",
                        str(private / "libVirtualSensor.so.0")], check=True)
        try:
            made.rename(ready)
        except OSError:
            if not ready.is_dir():
                raise
    return ready
