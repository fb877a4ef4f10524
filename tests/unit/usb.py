"""A folder like `/sys/bus/usb/devices`, with devices of one's choice."""

from collections.abc import Sequence
from pathlib import Path

__all__ = ["plug"]


def plug(
    root: Path, port: str, vendor: str, product: str, bus: int, number: int, *,
    serial: str = "", speed: float = 480, drivers: Sequence[str] = (),
) -> None:
    """Add a device; the kernel's driver of each of its interfaces is in `drivers`."""
    folder = root / port
    folder.mkdir(parents=True)
    for name, value in (("idVendor", vendor), ("idProduct", product), ("busnum", bus),
                        ("devnum", number), ("speed", speed), ("serial", serial)):
        if value != "":
            (folder / name).write_text(f"{value}\n")
    for interface, driver in enumerate(drivers):
        (root / f"{port}:1.{interface}").mkdir()
        (root / f"{port}:1.{interface}" / "driver").symlink_to(f"/sys/bus/usb/drivers/{driver}")
