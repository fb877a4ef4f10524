"""Where the tasks of a batch run: a Dask cluster of this machine's cores, or one that is there.

Dask's scheduler and workers run what they are sent, as pickles: who may connect may do all that
this user may. So there is no connection without TLS and a certificate on both sides; a plain
address is taken of the loopback interface alone, and only where the user names it.
"""

import logging
import os
import shutil
import signal
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from denseface.missing import explained
from denseface.service.errors import KeyFileError, UsageError, in_one_line, reason_of
from denseface.service.runtime.files import read_private_text
from denseface.service.tools.batch.engines.engine import Engine, EngineError, Work

__all__ = ["PRELOAD", "TlsFiles", "check_scheduler", "local_engine", "remote_engine"]

_LOOPBACK = "127.0.0.1"
_SILENT = logging.CRITICAL + 1
_START_S, _WORKERS_S = 30, 60
"""Longest wait for a scheduler, and for its first worker, seconds."""
_STOP_S = 5.0
"""Longest wait for the processes of a cluster that is closed, seconds."""
_OTHERS = 0o077
PRELOAD = "denseface.service.tools.batch.worker.process"
_CONFIG: Mapping[str, Any] = {
    # A task whose worker died comes back at once: it is for us to find the frame that did it.
    "distributed.scheduler.allowed-failures": 0,
    "distributed.scheduler.no-workers-timeout": "2 minutes",
    # Each worker's nanny starts it again, however long that takes; the cluster would end the nanny.
    "distributed.deploy.lost-worker-timeout": "1000 days",
    # No pages, no health checks: what the ports of HTTP answer is 404.
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    # Nothing is held in memory between tasks; a worker that takes too much is killed.
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.monitor-interval": "500ms",
    # The threads of the libraries, and not Dask's choice of when memory is given back.
    "distributed.nanny.pre-spawn-environ": {
        "OMP_NUM_THREADS": 1, "MKL_NUM_THREADS": 1, "OPENBLAS_NUM_THREADS": 1},
    # What nobody looks at costs memory and time.
    "distributed.worker.profile.enabled": False,
    "distributed.scheduler.active-memory-manager.start": False,
    "distributed.diagnostics.computations.max-history": 1,
    "distributed.diagnostics.erred-tasks.max-history": 1,
    "distributed.diagnostics.nvml": False,
    "distributed.admin.tick.interval": "500ms",
    "distributed.admin.log-length": 100,
    "distributed.admin.low-level-log-length": 10,
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.admin.system-monitor.log-length": 10,
    "distributed.admin.system-monitor.disk": False,
    "distributed.admin.system-monitor.gil.enabled": False,
}


class TlsFiles(NamedTuple):
    """What a scheduler is connected to with, PEM files: who may come in, and who one is."""

    ca: Path | None = None
    cert: Path | None = None
    key: Path | None = None


def local_engine(
    work: Work, workers: int, scratch: Path, *, preload: str = PRELOAD
) -> Engine:
    """Start a cluster for this run alone, on this machine, and give it as an engine.

    Its certificate is made now, is in the memory of its processes, and ends with them; only on the
    loopback interface is anything listened for.

    Parameters
    ----------
    scratch : folder that only this user can enter; removed at the end
    preload : module that each worker imports at its start

    Raises
    ------
    MissingPackageError
        The extra `batch` is not installed.
    EngineError
        The processes do not start.
    """
    with explained("batch"):
        import cryptography  # noqa: F401 - makes the certificate
        import dask.config
        from distributed import Client, LocalCluster, Security

        from denseface.service.tools.batch.engines._dask import DaskEngine
    settings = dask.config.set({**_CONFIG, "distributed.worker.preload": [preload]})
    _silence()
    cluster = None
    try:
        security = Security.temporary()
        cluster = LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=True, host=_LOOPBACK,
            protocol="tls://", security=security, dashboard_address=None,
            scheduler_kwargs={"dashboard": False, "dashboard_address": f"{_LOOPBACK}:0"},
            worker_dashboard_address=None, local_directory=str(scratch), silence_logs=_SILENT)
        client = Client(cluster, security=security, set_as_default=False)
    except BaseException as error:
        if cluster is not None:
            _close(cluster, scratch, busy=True)
        shutil.rmtree(scratch, ignore_errors=True)
        settings.__exit__(None, None, None)
        if isinstance(error, Exception):
            raise EngineError(f"the local cluster does not start: {in_one_line(error)}") from error
        raise

    def close(busy: bool) -> None:
        _close(cluster, scratch, busy=busy)
        settings.__exit__(None, None, None)

    return DaskEngine(client, work, close)


def check_scheduler(address: str, files: TlsFiles) -> None:
    """Check the address of a scheduler and what one connects to it with.

    Raises
    ------
    UsageError
        It is none, or plain TCP to another machine, or a file is not given that is needed.
    KeyFileError
        A file cannot be read, or others may read the key.
    """
    scheme, mark, _ = address.partition("://")
    try:
        parts = urlsplit(address)
        whole = bool(mark and parts.hostname and parts.port) and parts.path in ("", "/")
    except ValueError:
        whole = False
    if not whole or scheme not in ("tls", "tcp"):
        raise UsageError(f"--scheduler: expected tls://HOST:PORT, found {address!r}")
    given = {"--tls-ca": files.ca, "--tls-cert": files.cert, "--tls-key": files.key}
    if scheme == "tcp":
        if parts.hostname not in ("localhost", _LOOPBACK, "::1"):
            raise UsageError(f"--scheduler: {address}: whoever reaches a scheduler by plain TCP "
                             "runs what he likes on it and on its workers: expected tls://")
        if any(given.values()):
            raise UsageError(f"{next(flag for flag, path in given.items() if path)}: expected with "
                             "--scheduler tls://HOST:PORT")
        return
    for flag, path in given.items():
        if path is None:
            raise UsageError(f"--scheduler {address}: expected with {flag}")
        if flag == "--tls-key":
            read_private_text(path, _OTHERS)
            continue
        try:
            with path.open("rb"):
                pass
        except OSError as error:
            raise KeyFileError(f"{path}: {reason_of(error)}") from error


def remote_engine(work: Work, address: str, files: TlsFiles) -> Engine:
    """Connect to a scheduler that is there, and give its cluster as an engine.

    Raises
    ------
    MissingPackageError
        The extra `batch` is not installed.
    UsageError, KeyFileError
        As `check_scheduler`; also of files that are no certificate or key.
    EngineError
        There is no scheduler, it refuses the certificate, or it has no worker.
    """
    check_scheduler(address, files)
    with explained("batch"):
        from distributed import Client, Security

        from denseface.service.tools.batch.engines._dask import DaskEngine
    _silence()
    security = Security(require_encryption=False)
    if address.startswith("tls:"):
        security = Security(
            require_encryption=True, tls_ca_file=str(files.ca), tls_client_cert=str(files.cert),
            tls_client_key=str(files.key))
        try:
            security.get_connection_args("client")
        except OSError as error:  # ssl.SSLError, too
            raise KeyFileError(f"{files.ca}, {files.cert}, {files.key}: no certificates and key "
                               f"that go together: {reason_of(error)}") from error
    try:
        client = Client(address, security=security, set_as_default=False, timeout=_START_S)
    except (OSError, ValueError, TimeoutError) as error:
        raise EngineError(f"{address}: no scheduler can be reached: {in_one_line(error)}"
                          ) from error
    try:
        client.wait_for_workers(1, timeout=_WORKERS_S)
    except BaseException as error:
        with suppress(Exception):
            client.close(timeout=_STOP_S)
        if isinstance(error, Exception):
            raise EngineError(f"{address}: the scheduler has no worker after {_WORKERS_S} s"
                              ) from error
        raise
    return DaskEngine(client, work)


def _close(cluster: Any, scratch: Path, *, busy: bool) -> None:
    """End a cluster's processes, at once where they are busy, and remove what they wrote."""
    processes = [nanny.process.process for nanny in cluster.workers.values()
                 if getattr(nanny, "process", None) and nanny.process.process]
    for nanny in cluster.workers.values():
        nanny.auto_restart = False
    try:
        if busy:
            _kill(processes)
        with suppress(Exception):  # what it says of workers that are gone
            cluster.close(timeout=_STOP_S)
    finally:
        _kill(processes)
        shutil.rmtree(scratch, ignore_errors=True)


def _kill(processes: list[Any]) -> None:
    for process in processes:
        with suppress(ProcessLookupError, ValueError):
            if process.is_alive() and process.pid:
                os.kill(process.pid, signal.SIGKILL)


def _silence() -> None:
    """Let Dask log nothing: what matters to the user comes as an error."""
    for name in ("distributed", "tornado", "asyncio"):
        logging.getLogger(name).setLevel(_SILENT)
