"""The kiosk's sensor pulled out on each screen: said at once, and all goes on when it is back."""

import pytest

from denseface.capture import open_source
from tests.system.kiosk_pages import RawPage, another_kiosk, kiosk_service
from tests.system.running import RECORDINGS
from tests.virtual_sensor.clip import write_clip
from tests.virtual_sensor.control import Control
from tests.virtual_sensor.process import environment
from tests.virtual_sensor.scenes import face_clip


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory):
    """One service with a virtual sensor for all; its clip is of one person who stands still."""
    folder = tmp_path_factory.mktemp("kiosk")
    clip = face_clip(1)
    with Control(folder / "control", clip.path) as control, kiosk_service(
            "openni2:", folder, "--kiosk-countdown", "1",
            environment=environment(controls=[control])) as (running, url):
        yield control, running, url


@pytest.fixture
def sensor(kiosk):
    control, _, _ = kiosk
    clip = control.clip
    yield control
    control.clip = clip
    control.replug()


@pytest.fixture
def page(kiosk):
    with RawPage(kiosk[2]) as page:
        page.until("attract", trouble=None)
        yield page


def pull_and_replug(sensor, page, name):
    sensor.unplug()
    page.until(name, trouble="sensor")
    sensor.replug()
    page.until(name, trouble=None)


def test_on_the_first_screen_and_nobody_begins_meanwhile(sensor, page):
    sensor.unplug()
    page.until("attract", trouble="sensor")
    page.say("begin")
    sensor.replug()
    page.until("attract", trouble=None)
    assert {screen["name"] for screen in page.screens} == {"attract"}


def test_while_the_consent_is_read(sensor, page):
    page.say("begin")
    page.until("consent")
    pull_and_replug(sensor, page, "consent")
    page.say("consent", agreed=False, language="en")
    page.until("thanks")


def test_in_front_of_the_mirror_and_the_picture_comes_all_the_same(sensor, page, tmp_path):
    somebody, nobody = sensor.clip, tmp_path / "nobody"
    with open_source(RECORDINGS / "empty_room.oni") as room:
        write_clip(nobody, [(frame.depth.copy(), frame.rgb.copy()) for frame in room])
    sensor.clip = str(nobody)
    pull_and_replug(sensor, page, "attract")
    page.begin()
    page.until("position", trouble=None)
    while page.pictures == 0 or page.screen["position"]["hint"] != "nobody":
        page.take()
    # It waits for somebody, and so does not go on before the plug is out.
    sensor.unplug()
    page.until("position", trouble="sensor")
    sensor.clip = somebody
    sensor.replug()
    page.until("position", trouble=None)
    page.say("next")
    page.result()


def test_while_it_counts_down_which_begins_anew(kiosk, sensor, tmp_path):
    _, running, _ = kiosk
    # Long enough that it has not ended before the plug is out.
    with another_kiosk(running, tmp_path / "patient", "--kiosk-countdown", "5") as url, \
            RawPage(url) as page:
        page.begin()
        page.until("countdown")
        sensor.unplug()
        page.until("position", trouble="sensor")
        assert "failed" not in {screen["name"] for screen in page.screens}
        sensor.replug()
        page.result()


def test_while_a_face_is_looked_at_which_stays(sensor, page):
    page.begin()
    page.result()
    pull_and_replug(sensor, page, "result")
    page.say("again")
    page.until("position")
    page.say("next")
    first, = {head["capture_id"] for head, _ in page.faces}
    assert page.result() != first
    page.say("done")
    page.until("attract")
