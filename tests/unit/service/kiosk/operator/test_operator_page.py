"""The operator's routes: who gets in, and what each does."""

import asyncio
import json
import re

import pytest

from denseface.service.kiosk.operator.page import PUBLIC
from tests.unit.service.kiosk.operator.desk import ORIGIN, Hub, Page

API = "/operator/api"


@pytest.fixture
def page(tmp_path):
    return Page(tmp_path)


def all_routes(page):
    return [(method, re.sub(r"\{\w+\}", "capture-1", route.path))
            for route in page.routes for method in sorted(route.methods)]


def test_all_but_the_frame_and_the_way_in_need_a_session(page):
    routes = all_routes(page)
    assert len(routes) > 15
    assert set(routes) >= PUBLIC

    async def use():
        for cookie in (None, "", "x", "a" * 43, page.secret, page.token.digest()):
            async with page.browser() as browser:
                if cookie is not None:
                    browser.cookies.set("denseface_operator", cookie)
                for method, path in routes:
                    answer = await browser.request(method, path)
                    if (method, path) in PUBLIC:
                        assert answer.status_code in (200, 403, 429)
                    else:
                        assert answer.status_code == 401, (method, path)
                        assert method == "HEAD" or answer.json()["error"] == "login"
    asyncio.run(use())
    assert page.hub.said == []
    assert page.hub.gets == 0


def test_what_changes_something_is_a_post(page):
    for method, path in all_routes(page):
        changes = any(word in path for word in (
            "login", "logout", "delete", "retry", "drop", "restart"))
        assert (method == "POST") == changes, path


def test_another_origin_or_site_is_refused_with_a_good_session_too(page):
    async def use(browser):
        for headers in ({"Origin": "http://evil.example"}, {"Origin": "null"},
                        {"Origin": "http://127.0.0.1:8081"}, {"Origin": ""},
                        {"Origin": ORIGIN, "Sec-Fetch-Site": "cross-site"},
                        {"Origin": ORIGIN, "Sec-Fetch-Site": "same-site"}):
            for method, path in all_routes(page):
                answer = await browser.request(method, path, headers=headers)
                assert answer.status_code == 403, (method, path, headers)
        del browser.headers["Origin"]
        answer = await browser.post(f"{API}/captures/capture-1/delete")
        assert answer.status_code == 403
    page.run(use)
    assert page.hub.said == []


@pytest.mark.parametrize("origin", [ORIGIN, "https://face.example"])
def test_the_cookie_is_for_this_page_alone(page, origin):
    async def use():
        async with page.browser(origin=origin) as browser:
            answer = await browser.post(f"{API}/login", json={"token": page.secret})
            cookie = answer.headers["set-cookie"].lower()
            assert "httponly" in cookie
            assert "samesite=strict" in cookie
            assert "path=/operator" in cookie
            assert ("secure" in cookie) == origin.startswith("https")
            assert page.secret not in cookie
            assert (await browser.get(f"{API}/overview")).status_code == 200
    asyncio.run(use())


def test_a_wrong_token_has_to_wait_and_is_not_in_the_log(page, capfd):
    async def use():
        async with page.browser() as browser:
            for body in ({"token": "wrong-wrong-wrong"}, {"token": 7}, {"token": "x" * 300}):
                answer = await browser.post(f"{API}/login", json=body)
                assert (answer.status_code, answer.json()["error"]) == (403, "token")
            answer = await browser.post(f"{API}/login", json={"token": page.secret})
            assert answer.status_code == 429
            assert answer.json()["wait_s"] >= 1
            assert answer.headers["retry-after"]
            page.now += 2.0
            await page.logged_in(browser)
        async with page.browser("10.0.0.9") as browser:
            await page.logged_in(browser)
    asyncio.run(use())
    written = "".join(capfd.readouterr())
    assert "wrong-wrong" not in written
    assert page.secret not in written


def test_a_log_in_that_is_no_json_is_a_wrong_token(page):
    async def use():
        async with page.browser() as browser:
            for content, kind in ((b"", "application/json"), (b"[", "application/json"),
                                  (b"[]", "application/json"), (b"\xff", "application/json"),
                                  (json.dumps({"token": page.secret}).encode(), "text/plain")):
                page.now += 1000.0
                answer = await browser.post(
                    f"{API}/login", content=content, headers={"Content-Type": kind})
                assert answer.status_code == 403
    asyncio.run(use())


def test_logging_out_time_and_another_token_end_a_session(page):
    async def use():
        async with page.browser() as browser:
            await page.logged_in(browser)
            session = browser.cookies["denseface_operator"]
            await browser.post(f"{API}/logout")
            assert "denseface_operator" not in browser.cookies
            browser.cookies.set("denseface_operator", session, domain="127.0.0.1", path="/operator")
            assert (await browser.get(f"{API}/overview")).status_code == 401
        async with page.browser() as browser:
            await page.logged_in(browser)
            page.now += 3601.0
            assert (await browser.get(f"{API}/overview")).status_code == 401
        async with page.browser() as browser:
            await page.logged_in(browser)
            page.token.renew()
            assert (await browser.get(f"{API}/overview")).status_code == 401
    asyncio.run(use())


def test_the_overview_has_status_settings_and_statistics(page):
    async def use(browser):
        answer = (await browser.get(f"{API}/overview")).json()
        assert answer["kiosk"] == {"consent": True}
        assert answer["statistics"] == {"visits": 2}
        assert answer["status"]["free_bytes"] == 10**10
        page.hub.silent = True
        answer = (await browser.get(f"{API}/overview")).json()
        assert answer["status"] is None
        assert answer["kiosk"] == {"consent": True}
    page.run(use)


def test_captures_have_small_pictures_and_reports_made_once(page):
    async def use(browser):
        listed = (await browser.get(f"{API}/captures")).json()
        assert [one["capture_id"] for one in listed] == ["capture-1", "capture-2"]
        for _ in range(2):
            answer = await browser.get(f"{API}/captures/capture-1/thumbnail.png")
            assert answer.headers["content-type"] == "image/png"
            assert answer.headers["cache-control"] == "no-store"
            assert answer.content.startswith(b"\x89PNG")
            assert len(answer.content) < 100_000
            report = (await browser.get(f"{API}/captures/capture-1/report.json")).json()
            assert report["dense_points"] > 0
        assert page.hub.gets == 1
        for name in ("unknown", "..", "a.b", "x" * 65):
            answer = await browser.get(f"{API}/captures/{name}/thumbnail.png")
            assert answer.status_code == 404
        assert page.hub.gets == 2, "what is no id is asked of nobody"
    page.run(use)


@pytest.mark.parametrize("last", ["-1", "0", "51", "x", "1.5", "9" * 30, "١", ""])
def test_so_many_captures_are_listed_as_are_asked_for(page, last):
    async def use(browser):
        assert len((await browser.get(f"{API}/captures?last=1")).json()) == 1
        answer = await browser.get(f"{API}/captures", params={"last": last})
        assert answer.status_code == 400
    page.run(use)


def test_what_is_deleted_is_gone_from_links_memory_and_hub(page):
    async def use(browser):
        await browser.get(f"{API}/captures/capture-1/thumbnail.png")
        answer = await browser.post(f"{API}/captures/capture-1/delete")
        assert answer.status_code == 200
        assert page.forgotten == ["capture-1"]
        assert ("purge", "capture-1") in page.hub.said
        answer = await browser.get(f"{API}/captures/capture-1/thumbnail.png")
        assert answer.status_code == 404
    page.run(use)


def test_what_the_hub_removed_by_itself_is_not_shown_from_memory(page):
    async def use(browser):
        await browser.get(f"{API}/captures/capture-1/thumbnail.png")
        del page.hub.faces["capture-1"]
        answer = await browser.get(f"{API}/captures/capture-1/thumbnail.png")
        assert answer.status_code == 404
    page.run(use)


def test_a_small_picture_is_not_kept_for_long(page, monkeypatch):
    monkeypatch.setattr("denseface.service.kiosk.operator.looks._KEPT_S", 0.0)

    async def use(browser):
        while page.hub.gets < 3:  # each time anew, or it is asked for ever
            await browser.get(f"{API}/captures/capture-1/thumbnail.png")
            await asyncio.sleep(0)  # nothing of a request without a network waits
    page.run(use)


def test_dead_letters_are_listed_tried_again_and_dropped(page):
    async def use(browser):
        dead = (await browser.get(f"{API}/dead")).json()
        assert [one["capture_id"] for one in dead] == ["dead-1"]
        assert (await browser.post(f"{API}/dead/dead-1/retry")).status_code == 200
        assert (await browser.post(f"{API}/dead/dead-1/drop")).status_code == 200
        assert page.hub.said[-2:] == [("retry", "dead-1"), ("drop", "dead-1")]
        answer = await browser.post(f"{API}/dead/other/retry")
        assert answer.status_code == 409
        assert answer.json() == {"error": "refused", "message": "it is no dead letter"}
    page.run(use)


def test_a_sensor_is_restarted_by_its_name(page):
    async def use(browser):
        answer = await browser.post(f"{API}/sensor/restart", json={"sensor": "desk/1"})
        assert answer.status_code == 200
        assert page.hub.said[-1] == ("restart_sensor", "desk/1")
        for body in ({}, {"sensor": 5}, []):
            answer = await browser.post(f"{API}/sensor/restart", json=body)
            assert answer.status_code == 400
    page.run(use)


def test_the_log_is_a_file(page):
    async def use(browser):
        answer = await browser.get(f"{API}/log.txt")
        assert answer.headers["content-type"] == "text/plain; charset=utf-8"
        assert answer.headers["content-disposition"] == 'attachment; filename="denseface.log"'
    page.run(use)


def test_a_hub_that_is_silent_is_said(tmp_path):
    hub = Hub()
    page = Page(tmp_path, hub)

    async def use(browser):
        hub.silent = True
        for method, path in (("GET", "captures"), ("GET", "dead"), ("POST", "dead/dead-1/drop"),
                             ("POST", "captures/capture-1/delete")):
            answer = await browser.request(method, f"{API}/{path}")
            assert (answer.status_code, answer.json()["error"]) == (503, "hub")
    page.run(use)


def test_a_token_file_that_cannot_be_used_lets_nobody_in(page):
    async def use(browser):
        page.token.path.chmod(0o644)
        answer = await browser.get(f"{API}/overview")
        assert (answer.status_code, answer.json()["message"]) == (503, "")
        answer = await browser.post(f"{API}/login", json={"token": page.secret})
        assert (answer.status_code, answer.json()["error"]) == (503, "settings")
    page.run(use)
