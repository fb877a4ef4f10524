"""`denseface batch` as its users run it: interrupted, gone on with, on a cluster made by hand."""

import os
import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil
import pytest
from pyarrow import parquet

from tests.ports import free_port
from tests.system.running import RECORDINGS, REPOSITORY, denseface, run_here
from tests.system.snippets import snippets
from tests.waiting import LIMIT_S, until

RECORDED = 6
NAMES = "frontal_700", "side_light", "turned_18"
ENVIRONMENT = os.environ | {"PYTHONPATH": str(REPOSITORY)}


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """Six recordings, of three frames each: links."""
    top = tmp_path_factory.mktemp("archive")
    for at in range(RECORDED):
        name = NAMES[at % 3]
        for ending in (".oni", ".calibration.json"):
            if (RECORDINGS / f"{name}{ending}").exists():
                (top / f"{at:02}_{name}{ending}").symlink_to(RECORDINGS / f"{name}{ending}")
    return top


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return tmp_path_factory.mktemp("out") / "faces of all"


def faces(out):
    return {path: path.stat().st_mtime_ns for path in (out / "faces").rglob("*.ply")}


def recorded_of(out):
    """Leave out a face without its record, as where the end came between: it is made again."""
    recorded = {path.relative_to(out / "records").with_suffix("")
                for path in (out / "records").rglob("*.json")}
    return {path: at for path, at in faces(out).items()
            if path.relative_to(out / "faces").with_suffix("") in recorded}


_HOLDS = """
import os, sys, time
from pathlib import Path
faces, most = Path(os.environ["HELD_FACES"]), int(os.environ["HELD_AT"])
def hold(event, arguments):
    if event == "open" and arguments[2] & os.O_CREAT and str(arguments[0]).startswith(f"{faces}/"):
        while len(list(faces.rglob("*.ply"))) >= most:
            time.sleep(0.01)
sys.addaudithook(hold)
"""
"""A `sitecustomize` with which no more faces are written than so many."""


@contextmanager
def under_way(archive, out, more, folder):
    """Run it on a worker of its own until so many more faces are there; all of it must end.

    Some further faces it writes, but never all: it is under way however late the test looks.
    """
    wanted = len(faces(out)) + more
    (folder / "sitecustomize.py").write_text(_HOLDS)
    running = subprocess.Popen(
        [sys.executable, "-m", "denseface", "batch", archive, "--out", out, "--workers", "1"],
        cwd=REPOSITORY, start_new_session=True, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=ENVIRONMENT | {
            "PYTHONPATH": f"{folder}:{REPOSITORY}", "HELD_FACES": str(out / "faces"),
            "HELD_AT": str(wanted + 2)})
    try:
        until(lambda: len(faces(out)) >= wanted or running.poll() is not None)
        started = psutil.Process(running.pid).children(recursive=True)
        assert started
        yield running
        until(lambda: not any(process.is_running() for process in started))
    finally:
        with suppress(ProcessLookupError):
            os.killpg(running.pid, signal.SIGKILL)  # or whoever is left holds the pipes open
        running.communicate()


def test_killed_it_leaves_no_process_and_what_is_done(archive, out, tmp_path):
    with under_way(archive, out, 2, tmp_path) as running:
        running.kill()
    assert parquet.read_table(out / "summary.parquet").num_rows <= len(faces(out)) < 3 * RECORDED


def test_ctrl_c_ends_it_and_leaves_what_is_done_and_nothing_else(archive, out, tmp_path):
    before = recorded_of(out)
    with under_way(archive, out, 1, tmp_path) as running:
        os.killpg(running.pid, signal.SIGINT)  # as a terminal does
        said, complained = running.communicate(timeout=LIMIT_S)
    assert (running.returncode, said) == (130, "")
    assert f"stopped; what is done stays in {out}, and the same command goes on" in complained
    assert "Traceback" not in complained
    assert before.items() <= faces(out).items()
    assert {path.name for path in out.iterdir()} == {
        "batch.json", "faces", "records", "summary.parquet"}
    assert 2 <= len(faces(out)) < 3 * RECORDED
    assert list(out.rglob("*.tmp")) == []


def certificates(folder):
    """Make what docs/batch.md makes, as it says."""
    (shown,) = (block for block in snippets(REPOSITORY / "docs/batch.md") if not block.reason)
    subprocess.run(["sh", "-eu", "-c", shown.text], cwd=folder, check=True, capture_output=True)
    return [flag for name, path in (("ca-file", "ca.pem"), ("cert", "batch.pem"),
                                    ("key", "batch.key"))
            for flag in (f"--tls-{name}", str(folder / path))]


def start(program, *arguments):
    """Start a program of Dask's, with a task that is lost coming back at once."""
    return subprocess.Popen(
        [Path(sys.executable).with_name("dask"), program, *arguments], cwd=REPOSITORY,
        env=ENVIRONMENT | {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"},
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def test_it_goes_on_on_a_cluster_of_other_processes_by_tls(archive, out, tmp_path):
    if shutil.which("openssl") is None:
        pytest.skip("openssl is not installed")
    before = recorded_of(out)
    short = next(iter(before))
    os.truncate(short, 1000)
    tls, port = certificates(tmp_path), free_port()
    address = f"tls://127.0.0.1:{port}"
    common = [*tls, "--no-dashboard", "--dashboard-address", "127.0.0.1:0"]
    scheduler = start("scheduler", "--host", address, "--protocol", "tls", *common)
    worker = start("worker", address, "--nthreads", "1", "--no-nanny", "--local-directory",
                   tmp_path, *common)
    flags = [flag.replace("--tls-ca-file", "--tls-ca") for flag in tls]
    try:
        done = denseface("batch", archive, "--out", out, "--scheduler", address, *flags)
    finally:
        for process in (worker, scheduler):
            process.kill()
            process.wait(LIMIT_S)
    said = [line for line in done.stderr.splitlines() if not line.startswith("batch: ")]
    assert (done.returncode, said) == (0, [])
    assert done.stdout.startswith(f"{3 * RECORDED} faces; ")
    after = faces(out)
    assert len(after) == 3 * RECORDED
    assert {path for path in before if after[path] != before[path]} == {short}
    rows = parquet.read_table(out / "summary.parquet").to_pylist()
    assert sorted((Path(row["source"]).name, row["frame"]) for row in rows) == [
        (path.name, frame) for path in sorted(archive.glob("*.oni")) for frame in range(3)]
    assert {(out / row["output"]) for row in rows} == set(after)
    assert {path.name for path in out.iterdir()} == {
        "batch.json", "faces", "records", "summary.parquet", "summary.html"}


def test_other_settings_are_another_folder(archive, out):
    done = run_here("batch", archive, "--out", out, "--set", "smoothing=6")
    assert (done.returncode, done.stdout) == (2, "")
    assert "its faces were made otherwise: smoothing was not given, is 6.0: name another" in (
        done.stderr)


def test_the_page_is_written_anew_without_a_face_being_made(out):
    made, (page,) = faces(out), out.glob("summary.html")
    page.unlink()
    done = run_here("batch", "--summary", "--out", out)
    assert (done.returncode, done.stdout) == (0, f"{page}: look at it\n")
    assert page.read_text("utf-8").startswith("<!DOCTYPE html>")
    assert faces(out) == made
