"""Whole visits of the real service on a recording, without a browser."""

import os
import re
import signal
import socket
import subprocess
import sys
from urllib.request import urlopen

import psutil
import pytest

from denseface.service.errors import UnknownCaptureError
from tests.system.kiosk_pages import RawPage, is_closed, kiosk_service, kiosk_url, process_of
from tests.system.running import RECORDINGS, REPOSITORY, stopping
from tests.unit.service.kiosk.button.test_button import DOWN, HELD, UP
from tests.waiting import LIMIT_S, until

SOURCE = f"{RECORDINGS / 'frontal_700.oni'}?rate=real"


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory):
    """One service for all."""
    folder = tmp_path_factory.mktemp("kiosk")
    os.mkfifo(folder / "button")
    with kiosk_service(SOURCE, folder, "--kiosk-countdown", "0", "--metrics", "0",
                       "--kiosk-button", folder / "button",
                       environment=stopping(folder / "data")) as running:
        yield running


@pytest.fixture
def page(kiosk):
    with RawPage(kiosk_url(kiosk[0])) as page:
        yield page


def metric(running, name):
    url = until(lambda: re.search(r"http://\S+/metrics", running.log.read_text()))
    with urlopen(url[0]) as answer:  # noqa: S310
        return next(float(line.split()[1]) for line in answer.read().decode().splitlines()
                    if line.startswith(name + " "))


def test_no_picture_is_asked_of_the_sensor_before_yes(kiosk, page):
    running, _ = kiosk
    heartbeats = running.status().done
    before = metric(running, "denseface_previews_total")
    page.until("attract", trouble=None)
    page.say("next")
    page.say("begin")
    page.until("consent")
    page.say("next")
    with running.client() as client:  # two published statuses later
        follower = iter(client.hints(timeout=LIMIT_S))
        next(follower), next(follower)
    assert metric(running, "denseface_previews_total") == before
    assert running.status().done == heartbeats
    page.say("consent", agreed=False, language="en")
    page.until("thanks")
    assert metric(running, "denseface_previews_total") == before


def test_a_physical_button_begins_a_visit_and_agrees_to_nothing(kiosk, page):
    """No input device is at hand: a named pipe gives the records of one."""
    running, _ = kiosk
    visit = page.until("attract", trouble=None)["visit"]
    with (running.data.parent / "button").open("wb", buffering=0) as button:
        button.write(DOWN + HELD * 9 + UP)
        assert page.until("consent")["visit"] == visit
        button.write(DOWN + HELD * 9 + UP)
    page.say("consent", agreed=False, language="en")
    page.until("thanks")
    page.say("done")
    page.until("attract")
    assert page.screen["visit"] == visit + 1


def test_a_visit_ends_with_the_very_face_and_delete_leaves_nothing(kiosk, page):
    running, _ = kiosk
    page.begin()
    capture_id = page.result()
    assert page.pictures > 0
    with running.client() as client:
        face = client.get(capture_id)
        assert page.screen["result"]["dense_points"] == len(face.dense)
        report = face.report
        assert report.consent is not None
        assert (report.consent.language, report.consent.text_version) == ("en", "built-in-1")
        page.say("delete")
        assert page.until("thanks")["thanks"]["deleted"] is True
        with pytest.raises(UnknownCaptureError):
            client.get(capture_id)
    for path in running.data.rglob("*"):
        assert capture_id not in path.name
        assert not path.is_file() or capture_id.encode() not in path.read_bytes(), path
    page.until("attract")


def test_a_second_page_waits_and_is_given_the_kiosk_when_the_first_is_closed(kiosk):
    url = kiosk_url(kiosk[0])
    with RawPage(url) as first, RawPage(url) as second:
        first.begin()
        second.until("busy")
        first.result()
        first.close()
        second.until("attract")
        second.begin()
        second.result()
        assert len(second.faces) == 1


def test_a_kiosk_that_is_killed_is_back_and_so_is_its_page(kiosk, page):
    running, _ = kiosk
    page.begin()
    started = running.log.read_text().count("the page for visitors")
    process_of(running, "kiosk").kill()
    assert is_closed(page)
    until(lambda: running.log.read_text().count("the page for visitors") > started)
    with RawPage(kiosk_url(running)) as again:
        again.begin()
        again.result()
    assert running.status().restarts["kiosk"].exited == 1


def test_a_hub_that_is_killed_is_said_on_the_screen_and_all_is_back_by_itself(kiosk, page):
    running, _ = kiosk
    page.until("attract", trouble=None)
    page.say("begin")
    page.until("consent")
    hub = process_of(running, "hub")
    hub.suspend()  # else the visitor may have a face before it is killed
    page.say("consent", agreed=True, language="en")
    page.until("position")
    hub.kill()
    page.until("position", trouble="hub")
    page.until("position", trouble=None)
    page.say("next")
    page.result()


def test_a_worker_that_is_killed_while_it_makes_the_face_costs_a_moment(kiosk, page):
    running, _ = kiosk
    worker = running.stop_worker_amid_a_job()
    page.begin()
    page.until("reconstructing")
    until(lambda: worker.status() == psutil.STATUS_STOPPED)
    worker.kill()
    page.result()


def test_a_port_that_is_taken_keeps_nobody_from_pressing(tmp_path):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        log = tmp_path / "log"
        with log.open("w") as stderr:
            process = subprocess.Popen(
                [sys.executable, "-m", "denseface", "kiosk", "--address", f"ipc://{tmp_path}/h",
                 "--kiosk-address", str(port), "--kiosk-folder", str(tmp_path / "kiosk")],
                cwd=REPOSITORY, stderr=stderr, env=os.environ)
        until(lambda: "--kiosk-address" in log.read_text())
        other.close()
        until(lambda: "the page for visitors" in log.read_text())
        process.send_signal(signal.SIGTERM)
        assert process.wait(LIMIT_S) == 0
        assert log.read_text().count("--kiosk-address") == 1
