"""Two engines behind the same three calls; and who is let into the cluster of one of them."""

import socket
import ssl
import urllib.error
import urllib.request

import psutil
import pytest

from denseface.service.errors import KeyFileError, UsageError
from denseface.service.tools.batch.engines.clusters import (
    TlsFiles,
    check_scheduler,
    local_engine,
    remote_engine,
)
from denseface.service.tools.batch.engines.engine import EngineError
from tests.unit.service.tools.batch.pools import PoolEngine
from tests.unit.service.tools.batch.tasks import answer
from tests.waiting import LIMIT_S, until

TASKS = "tests.unit.service.tools.batch.tasks"


@pytest.fixture(scope="module")
def scratch(tmp_path_factory):
    return tmp_path_factory.mktemp("scratch") / "private"


@pytest.fixture(scope="module")
def dask(scratch):
    scratch.mkdir(mode=0o700)
    engine = local_engine(answer, 1, scratch, preload=TASKS)
    yield engine
    engine.close()


@pytest.fixture(scope="module")
def pool():
    engine = PoolEngine(answer, 1)
    yield engine
    engine.close()


@pytest.fixture(params=["dask", "pool"])
def engine(request):
    return request.getfixturevalue(request.param)


def test_tasks_come_back_with_their_handles_also_those_sent_meanwhile(engine):
    assert engine.width == 1
    sent = {engine.submit({"tell": number}): number for number in range(3)}
    came = {}
    for done in engine.completed():
        came[done.handle] = done.answer["told"]
        if len(sent) < 5:
            sent[engine.submit({"tell": len(sent)}, done.worker)] = len(sent)
    assert came == sent
    assert list(engine.completed()) == []


def test_a_task_that_kills_its_worker_is_lost_and_the_next_one_is_done(engine):
    lost = engine.submit({"die": True})
    assert list(engine.completed()) == [(lost, None, "")]
    kept = engine.submit({"tell": "on"})
    (done,) = engine.completed()
    assert (done.handle, done.answer["told"]) == (kept, "on")


def test_what_no_worker_can_do_ends_it(engine):
    engine.submit({"error": "no such folder"})
    with pytest.raises(EngineError, match=r"a worker cannot do what it is asked: .*no such folder"):
        list(engine.completed())


def listening():
    """Ports of this process and those that it started."""
    own = psutil.Process()
    return {one.laddr for process in (own, *own.children(recursive=True))
            for one in process.net_connections("inet") if one.status == psutil.CONN_LISTEN}


def test_who_has_no_certificate_of_this_run_is_let_in_nowhere(dask):
    dask.submit({"tell": 1})
    list(dask.completed())  # its worker listens
    ports = listening()
    assert len(ports) >= 4
    assert {address.ip for address in ports} == {"127.0.0.1"}
    secured = [port for _, port in ports if not says_http(port)]
    assert len(secured) >= 3, "scheduler, nanny and worker"
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    for port in secured:
        with (socket.create_connection(("127.0.0.1", port), timeout=LIMIT_S) as plain,
              context.wrap_socket(plain) as connection,
              # With TLS 1.3 the other side's refusal comes after the handshake.
              pytest.raises(ssl.SSLError, match="CERTIFICATE_REQUIRED")):
            connection.recv(1)
    for port in {port for _, port in ports}.difference(secured):
        for page in ("status", "health", "metrics", "info/main/workers.html", "api/v1/get_workers",
                     "json/counts.json"):
            with pytest.raises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(f"http://127.0.0.1:{port}/{page}", timeout=LIMIT_S)
            assert refused.value.code == 404
            refused.value.close()


def says_http(port):
    with socket.create_connection(("127.0.0.1", port), timeout=LIMIT_S) as connection:
        connection.sendall(b"GET / HTTP/1.0\r\n\r\n")
        try:
            return connection.recv(5) == b"HTTP/"
        except ConnectionResetError:
            return False


def test_a_client_of_dask_with_another_certificate_is_refused(dask):
    from distributed import Client, Security

    address = dask._client.scheduler.address
    with pytest.raises(OSError, match="certificate"):
        Client(address, security=Security.temporary(), timeout=LIMIT_S, set_as_default=False)


def test_nothing_is_left_when_it_is_closed_whatever_runs(scratch, dask):
    dask.submit({"tell": 1})
    ((_, answered, _),) = dask.completed()
    assert psutil.pid_exists(answered["pid"])
    ports = listening()
    dask.submit({"tell": 2})
    dask.close()
    dask.close()
    assert not scratch.exists()
    until(lambda: not psutil.pid_exists(answered["pid"]))
    assert ports
    assert not listening()


@pytest.mark.parametrize(("address", "why"), [
    ("tcp://10.0.0.5:8786", "runs what he likes"),
    ("tcp://example.org:8786", "runs what he likes"),
    ("10.0.0.5:8786", "expected tls://HOST:PORT"), ("tls://host", "expected tls://HOST:PORT"),
    ("tls://host:x", "expected tls://HOST:PORT"), ("ucx://host:1", "expected tls://HOST:PORT"),
    ("tls://host:1/a", "expected tls://HOST:PORT"), ("", "expected tls://HOST:PORT"),
    ("tls://host:8786", "expected with --tls-ca"),
])
def test_an_address_that_is_none_or_lets_anybody_in_is_refused(address, why):
    with pytest.raises(UsageError, match=why):
        check_scheduler(address, TlsFiles())


def test_files_that_are_no_certificates_are_named(tmp_path):
    paths = [tmp_path / name for name in ("ca.pem", "cert.pem", "key.pem")]
    with pytest.raises(KeyFileError, match=r"ca\.pem: No such file"):
        check_scheduler("tls://host:1", TlsFiles(*paths))
    for path in paths:
        path.write_text("x")
        path.chmod(0o644)
    with pytest.raises(KeyFileError, match=r"key\.pem: others may use this key"):
        check_scheduler("tls://host:1", TlsFiles(*paths))
    paths[2].chmod(0o600)
    with pytest.raises(KeyFileError, match="no certificates and key that go together"):
        remote_engine(answer, "tls://127.0.0.1:1", TlsFiles(*paths))
    with pytest.raises(UsageError, match="--tls-cert: expected with --scheduler tls://"):
        check_scheduler("tcp://localhost:1", TlsFiles(cert=paths[1]))
