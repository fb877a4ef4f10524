"""Certificates for tests, made with the openssl of the system."""

import subprocess
from pathlib import Path


def make_certificate(folder: Path, name: str, days: int = 2, host: str = "127.0.0.1") -> None:
    """Make NAME.pem and NAME.key, signed by itself; with no days it has expired."""
    request = folder / f"{name}.csr"
    run = {"check": True, "capture_output": True}
    subprocess.run([
        "openssl", "req", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes",
        "-keyout", folder / f"{name}.key", "-out", request, "-subj", "/CN=kiosk"], **run)
    extensions = folder / f"{name}.ext"
    extensions.write_text(f"subjectAltName=IP:{host}\n")
    subprocess.run([
        "openssl", "x509", "-req", "-in", request, "-signkey", folder / f"{name}.key", "-days",
        str(days), "-extfile", extensions, "-out", folder / f"{name}.pem"], **run)
