"""The running service as an operator and as other programs see it."""

import asyncio
import json
import re
import subprocess
import sys
import urllib.error
import urllib.request

import pytest
from prometheus_client.parser import text_string_to_metric_families

from denseface import AsyncClient
from tests.system.running import RECORDINGS, REPOSITORY, service
from tests.virtual_sensor.clip import write_clip
from tests.virtual_sensor.process import environment, play
from tests.waiting import LIMIT_S, until


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    data = tmp_path_factory.mktemp("watched") / "data"
    with service(RECORDINGS / "frontal_700.oni", data, "--metrics", "0", "--log", "json") as up:
        yield up


def events(running):
    return [json.loads(line, parse_constant=pytest.fail)
            for line in running.log.read_text().splitlines()]


def page(running, name):
    (url,) = [one["url"] for one in events(running) if one["event"] == "metrics"]
    assert url.startswith("http://127.0.0.1:")
    try:
        with urllib.request.urlopen(url.replace("/metrics", name), timeout=LIMIT_S) as answer:  # noqa: S310
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


def figures(running):
    status, text = page(running, "/metrics")
    assert status == 200
    return {(one.name.removeprefix("denseface_"), *one.labels.values()): one.value
            for family in text_string_to_metric_families(text) for one in family.samples}


def healthy(running):
    status, text = page(running, "/healthz")
    assert status == (200 if json.loads(text)["healthy"] else 503)
    return json.loads(text)


def test_a_press_shows_in_the_metrics(running):
    before = figures(running)
    with running.client() as client:
        client.get(client.press())
    until(lambda: figures(running)["done_total",] == before["done_total",] + 1)
    after = figures(running)
    assert after["accepted_total",] == before["accepted_total",] + 1
    for stage in ("press_to_accepted", "accepted_to_dispatched", "dispatched_to_result",
                  "press_to_published", "recon_total"):
        assert after["latency_seconds_count", stage] >= 1
    assert (after["sensors",], after["workers",]) == (1, 1)
    assert after["kept_captures", "done"] == before["kept_captures", "done"] + 1
    assert after["disk_free_bytes",] > 0
    assert after["process_resident_memory_bytes",] > 0


def test_without_a_worker_it_is_not_healthy_and_with_the_next_it_is_again(running):
    until(lambda: healthy(running)["healthy"])
    worker = running.worker()
    worker.suspend()
    until(lambda: healthy(running)["missing"] == ["worker: none is alive"])
    worker.resume()
    until(lambda: healthy(running)["healthy"])


def test_the_status_for_people_and_for_programs(running):
    with running.client() as client:
        client.get(client.press())
    table = running.run("status")
    assert "from press to outcome" in table.stdout
    shown = json.loads(running.run("status", "--json").stdout)
    assert (shown["ready"], shown["address"]) == (True, running.address)
    assert shown["since_start"]["accepted"] >= 1
    assert shown["latencies"]["press_to_published"]["count"] >= 1


def test_previews_go_on_while_pressing_and_end_with_the_subscriber(running):
    async def main():
        async with AsyncClient(running.address) as client:
            found = []

            async def look():
                async for preview in client.previews(timeout=LIMIT_S):
                    found.append(preview)  # noqa: PERF401

            looks = asyncio.ensure_future(look())
            while not found:
                await asyncio.sleep(0.02)
            face = await client.get(await client.press())
            seen = len(found)
            while len(found) < seen + 3:
                await asyncio.sleep(0.02)
            looks.cancel()
            await asyncio.gather(looks, return_exceptions=True)
            return found, face

    found, face = asyncio.run(asyncio.wait_for(main(), LIMIT_S))
    assert face.report.dense_points > 0
    assert {one.image.shape for one in found} == {(480, 640, 3)}
    assert len({one.epoch for one in found}) == 1
    numbers = [one.sequence for one in found]
    assert numbers == sorted(set(numbers))
    until(lambda: figures(running)["subscriptions", "preview"] == 0)


def test_the_preview_of_a_recording_goes_on_when_its_frame_was_taken(running):
    with running.client() as client:
        previews = client.previews(timeout=LIMIT_S)
        shown = next(previews)
        face = client.get(client.press())
        until(lambda: next(previews).timestamp_us != shown.timestamp_us)
        previews.close()
    assert face.report.dense_points > 0


def test_the_example_presses_and_gets_its_face(running, tmp_path):
    example = REPOSITORY / "docs" / "examples" / "press_and_subscribe.py"
    assert len(example.read_text().splitlines()) <= 15
    done = subprocess.run(
        [sys.executable, str(example)], cwd=tmp_path, check=False, capture_output=True, text=True,
        timeout=LIMIT_S, env={"DENSEFACE_ADDRESS": running.address, "PYTHONPATH": str(REPOSITORY)})
    assert (done.returncode, done.stderr) == (0, "")
    (written,) = tmp_path.glob("*.ply")
    points = re.search(rf"^{written.stem}: (\d+) points", done.stdout, re.MULTILINE).group(1)
    assert f"element vertex {points}\n".encode() in written.read_bytes()[:1000]


def test_every_line_of_every_process_is_json(running):
    worker = running.worker()
    worker.kill()
    worker.wait(LIMIT_S)
    assert running.worker() != worker  # the next one: the hub may not know yet that this is gone
    everyone = {"up", "hub", "capture", "worker"}  # who supervises has something to say now
    until(lambda: {one["process"] for one in events(running)} >= everyone)
    found = events(running)
    assert all({"event", "level", "timestamp"} <= one.keys() for one in found)
    assert max(len(line) for line in running.log.read_text().splitlines()) < 4096


def test_a_live_sensor_shows_itself_between_presses(tmp_path):
    frames, _ = play(RECORDINGS / "frontal_700.oni", max_frames=2)
    write_clip(tmp_path / "clip", [(frame.depth, frame.rgb) for frame in frames])
    with service("openni2:", tmp_path / "data", environment=environment(tmp_path / "clip")) as up, \
            up.client() as client:
        previews = client.previews(timeout=LIMIT_S)
        first = next(previews)
        face = client.get(client.press())
        assert len(face.initial) > 10_000
        until(lambda: next(previews).timestamp_us > first.timestamp_us)
