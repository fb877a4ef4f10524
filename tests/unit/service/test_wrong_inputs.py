"""Wrong inputs of every command: one clear line, the right exit status, and nothing on stdout.

What is written is what a stranger types: wrong numbers, empty words, folders for files and files
for folders, names that no system has, pipes and devices.
"""

import os
import sys

import pytest
import structlog

from denseface.service.cli import main
from denseface.service.commands import COMMANDS
from denseface.service.log.output import process_log
from tests.waiting import LIMIT_S

NONE = ["--address", "ipc://{tmp}/none"]
BOARD = ["--board", "9x6", "--square", "20", "-o", "a.calibration.json"]
LONG = "x" * 5000
WHOLE = "expected a whole number, at least "
SECONDS = "expected seconds, more than 0 and at most 86400, found "
TIME = "expected a time such as 2026-01-31T14:30, UTC or with a zone, found "
CAPTURE_ID = "expected letters, digits, - and _, at most 64"
KIND = "not a known kind of source; accepted: NAME.npz, NAME.oni, "


@pytest.fixture(autouse=True)
def _place(tmp_path, monkeypatch):
    """A folder `d`, a file `f`, a pipe `p`; a user of nothing but this."""
    (tmp_path / "d").mkdir()
    (tmp_path / "f").write_text("x")
    (tmp_path / "e.npz").touch()
    (tmp_path / "e.oni").touch()
    os.mkfifo(tmp_path / "p")
    monkeypatch.chdir(tmp_path)
    for name in ("HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_STATE_HOME"):
        monkeypatch.setenv(name, str(tmp_path))
    for name in [one for one in os.environ if one.startswith("DENSEFACE_")]:
        monkeypatch.delenv(name)
    monkeypatch.setattr(sys, "stderr", sys.stderr)  # a daemon's log replaces it
    os.umask(umask := os.umask(0o077))  # and it sets this
    yield
    os.umask(umask)
    structlog.reset_defaults()


@pytest.mark.parametrize(("arguments", "status", "line"), [
    (["fly"], 2, "unknown command 'fly', expected reconstruct, "),
    (["statsu"], 2, "unknown command 'statsu'; did you mean status? (see denseface --help)"),
    (["--x"], 2, "denseface: unknown flag --x (see denseface --help)"),
    (["status", "--helpp"], 2, "unknown flag --helpp; did you mean --help? (see denseface status"),
    (["status", "x"], 2, "'x': expected nothing more (see denseface status --help)"),
    (["help", "pres"], 2, "unknown command 'pres'; did you mean press?"),
    (["keys"], 2, "required: new|allow|revoke|list (see denseface keys --help)"),
    (["keys", "alow"], 2, "unknown command 'alow'; did you mean allow? (see denseface keys"),
    (["keys", "allow", "--x"], 2, "unknown flag --x (see denseface keys allow --help)"),
    (["dead", "retry", "--x"], 2, "unknown flag --x (see denseface dead --help)"),

    (["reconstruct", ""], 2, "INPUT: expected a word, found ''"),
    (["reconstruct", "f"], 2, f"f: {KIND}"),
    (["reconstruct", "p"], 2, f"p: {KIND}"),
    (["reconstruct", "/dev/null"], 2, f"/dev/null: {KIND}"),
    (["reconstruct", "e.npz"], 2, "e.npz: no .npz file, or one that is damaged or cut short"),
    (["reconstruct", "e.oni"], 2, "e.oni: "),
    (["reconstruct", os.fsdecode(b"bad\xff.npz")], 2, r"bad\udcff.npz: no such file"),
    (["reconstruct", "~/x.npz"], 2, "~/x.npz: no such file"),
    (["reconstruct", LONG], 2, "xxx... the name is too long"),
    (["reconstruct", "http://x/y.oni"], 2, "http://x/y.oni: no such file"),
    (["reconstruct", "e.npz", "-o", "a.ply", "--compact"], 2, "a.ply: compact is for .glb, not "),
    (["reconstruct", "e.npz", "-o", "d/", "--textured"], 2, "d/e.ply: texture is for .glb or .obj"),
    (["reconstruct", "e.npz", "--textured"], 2, "texture: expected with a file of the face"),
    (["reconstruct", "e.npz", "-o", "a.glb", "--holes", "fill"], 2, "--holes: expected lea"),
    (["reconstruct", "e.npz", "-o", "a.glb", "--copyright", "a\nb"], 2, "copyright: expected a li"),
    (["get", "a", *NONE, "--save", "a.stl", "--textured"], 2, "a.stl: texture is for .glb or .obj"),
    (["reconstruct", "e.oni?speed=2"], 2, "'speed=2': expected rate=asked or rate=real, "),
    (["reconstruct", "e.npz", "--frame", "9" * 5000], 2, f"--frame: {WHOLE}0, found '999"),
    (["reconstruct", "e.npz", "--frame", "1e3"], 2, f"--frame: {WHOLE}0, found '1e3'"),
    (["reconstruct", "e.npz", "--frames", "33"], 2, "a whole number from 1 to 32, found '33'"),
    (["reconstruct", "e.npz", "--frames", "nan"], 2, "a whole number from 1 to 32, found 'nan'"),
    (["reconstruct", "e.npz", "-o", ""], 2, "-o/--output: expected OUT|DIR/, found ''"),
    (["reconstruct", "e.npz", "--set", ""], 2, "--set: expected NAME=VALUE, found ''"),
    (["reconstruct", "e.npz", "--set", "ratio="], 2, "--set ratio: expected a number, found ''"),
    (["reconstruct", "e.npz", "--set", "ratio=nan"], 2, "--set ratio: expected at "),
    (["reconstruct", "e.npz", "--set", "ratio=1e400"], 2, "expected at most 100, found '1e400'"),
    (["reconstruct", "e.npz", "--set", "ration=3"], 2, "did you mean ratio? expected NAME=VALUE"),
    (["reconstruct", "e.npz", "--preset", ""], 2, "--preset: expected NAME, found ''"),
    (["reconstruct", "e.npz", "--preset", "besst"], 2,
     "--preset: expected 'paper', 'faithful', 'light' or 'best', found 'besst'"),
    (["reconstruct", "e.npz", "--rotate", "91"], 2, "expected 0, 90, 180 or 270, found '91'"),
    (["reconstruct", "e.npz", "--rotate", "up"], 2, "--rotate: "),
    (["reconstruct", "--depth", "p", "--color", "p"], 2, "p: Not a regular file"),

    (["view"], 2, "expected FILE or ID, --last or --depth"),
    (["view", ""], 2, "FILE|ID: expected a word, found ''"),
    (["view", "f"], 2, f"f: {KIND}"),
    (["view", "p"], 2, f"p: {KIND}"),
    (["view", "d"], 2, "d: "),
    (["view", "e.npz"], 2, "e.npz: no .npz file, or one that is damaged or cut short"),
    (["view", "e.oni"], 2, "e.oni: "),
    (["view", "none.ply"], 2, "none.ply: "),
    (["view", "openni2:"], 2, "openni2:: expected a .npz or .oni file or a folder"),
    (["view", "x", "--address", "ftp://x"], 2, "ftp://x: expected ipc://PATH or tcp://HOST:PORT"),
    (["view", "e.npz", "--port", "65536"], 2, "--port: expected a whole number from 0 to 65535"),
    (["view", "e.npz", "--frame", "-1"], 2, f"--frame: {WHOLE}0, found '-1'"),
    (["view", "e.npz", "--color", "f"], 2, "--color is given without --depth"),
    (["view", "e.npz", "--unit", "ell"], 2, "--unit "),
    (["view", "e.npz", "--save", "x.ply"], 2, "x.ply: expected a name that ends in .rrd"),
    (["view", "e.npz", "--preset", "x"], 2,
     "--preset: expected 'paper', 'faithful', 'light' or 'best'"),

    (["batch"], 2, "required: -o/--out"),
    (["batch", "-o", "o"], 2, "expected INPUT or --summary, found neither"),
    (["batch", "e.npz", "-o", "o", "--summary"], 2, "expected INPUT or --summary, found both"),
    (["batch", "-o", "d", "--summary"], 2, "d: has no summary.parquet"),
    (["batch", "e.npz"], 2, "required: -o/--out"),
    (["batch", "none.npz", "-o", "o"], 2, "none.npz: no such file or folder"),
    (["batch", "", "-o", "o"], 2, "INPUT: "),
    (["batch", "f", "-o", "o"], 2, "f: expected a .npz or .oni file or a folder"),
    (["batch", "p", "-o", "o"], 2, "p: expected a .npz or .oni file or a folder"),
    (["batch", "openni2:", "-o", "o"], 2, "openni2:: expected a .npz or .oni file or a folder"),
    (["batch", LONG, "-o", "o"], 2, "the name is too long"),
    (["batch", "e.npz", "-o", "f"], 2, "f/batch.json: lies in what is a file, expected a folder"),
    (["batch", "e.npz", "-o", "."], 2, ": has files in it and no batch.json"),
    (["batch", "d", "-o", "d"], 2, "d: is where faces are written"),
    (["batch", "e.npz", "-o", "o", "--format", "doc"], 2, "--format: "),
    (["batch", "e.npz", "-o", "o", "--textured"], 2, "texture"),
    (["batch", "e.npz", "-o", "o", "--set", "x=1"], 2, "--set x=1: "),
    (["batch", "e.npz", "-o", "o", "--unit", "ell"], 2, "--unit "),
    (["batch", "e.npz", "-o", "o", "--calibration", "none"], 2, "none: No such file"),
    (["batch", "e.npz", "-o", "o", "--every", "0"], 2, f"--every: {WHOLE}1, found '0'"),
    (["batch", "e.npz", "-o", "o", "--workers", "0"], 2, "from 1 to 1024, found '0'"),
    (["batch", "e.npz", "-o", "o", "--workers", "5000"], 2,
     "--workers: expected a whole number from 1 to 1024, found '5000'"),
    (["batch", "e.npz", "-o", "o", "--time-limit", "0"], 2, f"--time-limit: {SECONDS}'0'"),
    (["batch", "e.npz", "-o", "o", "--tls-ca", "f"], 2, "--tls-ca, --tls-cert or --tls-key: exp"),
    (["batch", "e.npz", "-o", "o", "--workers", "2", "--scheduler", "tls://h:1"], 2,
     "--workers is given with --scheduler"),
    (["batch", "e.npz", "-o", "o", "--scheduler", "h:1"], 2,
     "--scheduler: expected tls://HOST:PORT, found 'h:1'"),
    (["batch", "e.npz", "-o", "o", "--scheduler", "tcp://192.168.0.9:8786"], 2,
     "tcp://192.168.0.9:8786: whoever reaches a scheduler by plain TCP runs what he likes"),
    (["batch", "e.npz", "-o", "o", "--scheduler", "tls://h:8786"], 2,
     "--scheduler tls://h:8786: expected with --tls-ca"),

    (["compare"], 2, "required: A, B"),
    (["compare", "", "f"], 2, "A: expected a word, found ''"),
    (["compare", "none.npz", "f"], 2, "none.npz: no such file"),
    (["compare", "none.oni", "f"], 2, "none.oni: no such file"),
    (["compare", "f", "f"], 2, "f: expected a face or mesh (.ply .pcd .obj .stl .glb .npz), a "),
    (["compare", "p", "f"], 2, "p: expected a face or mesh ("),
    (["compare", "/dev/null", "f"], 2, "/dev/null: expected a face or mesh ("),
    (["compare", "d", "f"], 2, "d: no faces, meshes, frames or recordings in it ("),
    (["compare", "e.npz", "f"], 2, "e.npz: no .npz file, or one that is damaged or cut short"),
    (["compare", "e.oni", "f"], 2, "e.oni: "),
    (["compare", "a.b/c", "f"], 2, "a.b/c: expected a face or mesh ("),
    (["compare", LONG, "f"], 2, "xxx... the name is too long"),
    (["compare", "e.npz", "f", "-o", "x.pdf"], 2, "x.pdf: ending .pdf, expected one of .html "),
    (["compare", "e.npz", "x.ply", "-o", "x.ply"], 2, "x.ply: is read, and would be replaced"),
    (["compare", "e.npz", "f", "-o", "f/x.png"], 2, "f/x.png: "),
    (["compare", "e.npz", "f", "--confidence", "100"], 2,
     "--confidence: expected a percentage from 50 to 99.9, found '100'"),
    (["compare", "e.npz", "f", "--confidence", "nan"], 2, "from 50 to 99.9, found 'nan'"),
    (["compare", "e.npz", "f", "--beyond", "0"], 2, "expected millimetres, 0.01 to 100, found '0'"),
    (["compare", "e.npz", "f", "--frames", "33"], 2, "a whole number from 1 to 32, found '33'"),
    (["compare", "e.npz", "f", "--captures", "0"], 2, f"--captures: {WHOLE}1, found '0'"),

    (["evaluate"], 2, "required: INPUT, --truth"),
    (["evaluate", "e.npz", "--truth", "none.ply"], 2, "none.ply: "),
    (["evaluate", "e.npz", "--truth", "f"], 2, "f: ending missing, expected one of .ply "),
    (["evaluate", "e.npz", "--truth", "d"], 2, "d: ending missing, expected one of .ply "),
    (["evaluate", "e.npz", "--truth", "e.npz", "-o", "f"], 2, "f: is a file, expected a folder"),
    (["evaluate", "e.npz", "--truth", "x.ply", "--unit", "inch"], 2, "--unit: "),
    (["evaluate", "e.npz", "--truth", "x.ply", "--align", "yes"], 2, "--align: "),
    (["evaluate", "e.npz", "--truth", "x.ply", "--each-preset", "--preset", "best"], 2,
     "--each-preset is given with --preset or --set: "),
    (["evaluate", "e.npz", "--truth", "x.ply", "--frames", "2", "--all-frames"], 2,
     "--frames is given with --all-frames: "),

    (["calibrate"], 2, "required: --infrared, --color, --square"),
    (["calibrate", "--infrared", "d", "--color", "d", *BOARD], 2, "d: no images (.jpeg"),
    (["calibrate", "--infrared", "f", "--color", "f", *BOARD], 2, "f: not an image"),
    (["calibrate", "--infrared", "p", "--color", "p", *BOARD], 2, "p: Not a regular file"),
    (["calibrate", "--infrared", "d", "--color", "d", *BOARD, "--square", "nan"], 2,
     "--square: expected millimetres, 1 to 500, found 'nan'"),
    (["calibrate", "--infrared", "d", "--color", "d", *BOARD, "--board", "9"], 2,
     "--board: expected columns and rows such as 9x6, 3 to 60 each, found '9'"),

    (["live", "--source", ""], 2, "--source: expected URI, found ''"),
    (["live", "--source", "f"], 2, f"f: {KIND}"),
    (["live", "--source", "openni3:"], 2, f"openni3:: {KIND}"),
    (["live", "--seconds", "inf"], 2, f"--seconds: {SECONDS}'inf'"),
    (["live", "--frames", "1e9"], 2, f"--frames: {WHOLE}1, found '1e9'"),
    (["live", "--frames", "-1"], 2, f"--frames: {WHOLE}1, found '-1'"),

    (["record"], 2, "required: OUT"),
    (["record", "x.mp4"], 2, "x.mp4: expected NAME.oni or a folder"),
    (["record", "f"], 2, "f: is a file, expected a folder"),
    (["record", "/dev/null"], 2, "/dev/null: is a file, expected a folder"),
    (["record", "f/x.oni"], 2, "f/x.oni: "),
    (["record", f"{LONG}.oni"], 2, "xxx... the name is too long"),
    (["record", "x.oni", "--seconds", "-3"], 2, f"--seconds: {SECONDS}'-3'"),
    (["record", "x.oni", "--mode", "0777777"], 2, "the first a 6 or 7, found '0777777'"),
    (["record", "d", "--source", "none.oni"], 2, "none.oni: no such file"),

    (["bench", "f"], 2, f"f: {KIND}"),
    (["bench", "none.npz"], 2, "none.npz: no such file"),
    (["bench", "--calibration", "f"], 2, "f: "),
    (["bench", "--preset", "x"], 2, "--preset: expected 'paper', 'faithful', 'light' or 'best'"),
    (["completion"], 2, "required: SHELL"),
    (["completion", "tcsh"], 2, "SHELL: expected bash, zsh or fish, found 'tcsh'"),
    (["install-units", "--workers", "0"], 2,
     "--workers: expected a whole number from 1 to 256, found '0'"),
    (["install-units", "--dry-run", "--uninstall"], 2,
     "--uninstall: not allowed with argument --dry-run"),
    (["install-units", "--dry-run", "--sensor", "a b"], 2, "--sensor a b: expected letters, "),
    (["install-units", "--dry-run", "--sensor", "a", "--sensor", "a"], 2,
     "--sensor a: given twice, expected another name each"),
    (["install-units", "--folder", ""], 2, "--folder: expected DIR, found ''"),
    (["install-units", "--folder", "f"], 2, "f: File exists"),
    (["install-units", "--folder", "f/g"], 2, "f/g: "),

    (["export"], 2, "required: FACE.npz|ID"),
    (["export", "e.npz"], 2, "-o/--output: expected OUT, or --preview or --report"),
    (["export", "e.npz", "-o", "a.ply"], 2, "e.npz: no .npz file, or one that is damaged"),
    (["export", "none.npz", "-o", "a.ply"], 2, "none.npz: No such file"),
    (["export", "f", "-o", "a.ply"], 2, "f: faces are read back from .npz alone"),
    (["export", "e.npz", "-o", "e.npz"], 2, "e.npz: is read, and would be replaced by what is wr"),
    (["export", "e.npz", "-o", "a.ply", "--solid", "mask"], 2, "a.ply: printing (solid, wall, hei"),
    (["export", "e.npz", "-o", "a.3mf", "--solid", "open"], 2, "expected plate or mask, found op"),
    (["export", "e.npz", "-o", "a.stl", "--solid", "x"], 2, "expected plate, mask or open, found"),
    (["export", "e.npz", "-o", "a.stl", "--wall", "0"], 2, "expected millimetres from 0.8 to 10"),
    (["export", "e.npz", "-o", "a.stl", "--height", "1e9"], 2, "millimetres from 10 to 500, found"),
    (["export", "e.npz", "-o", "a.glb", "--textured"], 2, "e.npz: has no colour image for a text"),
    (["export", "a b", "-o", "a.ply", *NONE], 2, CAPTURE_ID),

    (["info"], 2, "required: FILE"),
    (["info", ""], 2, "FILE: expected a word, found ''"),
    (["info", "d"], 2, "d: is a folder, expected a file"),
    (["info", "p"], 2, "p: Not a regular file"),
    (["info", "f"], 2, "f: nothing that is known here: expected a face (.npz .ply .pcd .obj"),
    (["info", "e.npz"], 2, "e.npz: is empty"),
    (["info", f"{LONG}.npz"], 2, "the name is too long"),

    (["up", "--data", "f"], 2, "f: is a file, expected a folder"),
    (["up", "--data", "f/x"], 2, "f/x: lies in what is a file, expected a folder"),
    (["up", "--data", "/dev/null"], 2, "/dev/null: is a file, expected a folder"),
    (["up", "--data", ""], 2, "--data: expected DIR, found ''"),
    (["up", "--address", "http://x"], 2, "http://x: expected ipc://PATH or tcp://HOST:PORT"),
    (["up", "--address", "ipc://f"], 2, "ipc://f: an ipc address is ipc:// and an absolute path"),
    (["up", "--listen", "tcp://0.0.0.0:99999"], 2, "tcp://0.0.0.0:99999: expected ipc://PATH or"),
    (["up", "--retention", "0"], 2, "--retention: expected a time of 1 s or more such as 24h, 90m"),
    (["up", "--retention", "-1h"], 2, "--retention: expected a value; one that begins with - goes"),
    (["up", "--metrics", "99999"], 2, "--metrics: expected PORT, 127.0.0.1:PORT or [::1]:PORT, or"),
    (["up", "--workers", "1.5"], 2, "expected a whole number from 1 to 256, found '1.5'"),
    (["up", "--log", "xml"], 2, "--log: expected text or json, found 'xml'"),
    (["up", "--preset", "x"], 2,
     "--preset: expected 'paper', 'faithful', 'light' or 'best', found 'x'"),
    (["up", "--source", "a", "--source", "a"], 2, "--source a: given twice"),
    (["up", "--kiosk-address", "x"], 2, "--kiosk-address: expected PORT, or an IP address and"),
    (["up", "--kiosk-countdown", "-1"], 2, "--kiosk-countdown: expected at least 0, found '-1'"),
    (["up", "--kiosk-countdown", "nan"], 2, "--kiosk-countdown: expected a whole number, found"),
    (["up", "--kiosk-idle-s", "0"], 2, "--kiosk-idle-s: expected at least 5, found '0'"),
    (["up", "--kiosk-languages", "xx"], 2, "--kiosk-languages: expected some of ar, de, en, es, "),
    (["up", "--kiosk-folder", "f"], 2, "--kiosk-folder: f: is a file, expected a folder"),
    (["up", "--kiosk-consent-text", "d"], 2, "--kiosk-consent-text: d: is a folder, expected a"),
    (["up", "--kiosk-certificate", "f"], 2, "expected both --kiosk-certificate and --kiosk-key"),

    (["hub", "--data", "f"], 2, "f: is a file, expected a folder"),
    (["hub", "--address", "ipc://{tmp}/f"], 2, "there is a file of that name, and it is no socket"),
    (["capture", "--name", "a b", *NONE], 2, "--name: expected 1 to 100 ASCII characters without"),
    (["capture", "--source", "", *NONE], 2, "--source: expected URI, found ''"),
    (["worker", "--address", "ftp://x"], 2, "ftp://x: expected ipc://PATH or tcp://HOST:PORT"),
    (["kiosk", "--kiosk-certificate", "f"], 2, "expected both --kiosk-certificate and --kiosk-key"),
    (["kiosk", "--new-operator-token", "--kiosk-folder", "f"], 2, "is a file, expected a folder"),
    (["doctor", "--source", ""], 2, "--source: expected URI, found ''"),

    (["press", "--timeout", "0", *NONE], 2, f"--timeout: {SECONDS}'0'"),
    (["press", "--timeout", "nan", *NONE], 2, f"--timeout: {SECONDS}'nan'"),
    (["press", "--timeout", "1e9", *NONE], 2, f"--timeout: {SECONDS}'1e9'"),
    (["press", "--timeout", "0.01", *NONE], 1, "no answer from the hub within 0.01 s: there is no"),
    (["press", "--id", "", *NONE], 2, "--id: expected ID, found ''"),
    (["press", "--id", LONG, *NONE], 2, CAPTURE_ID),
    (["press", "--sensor", "a b", *NONE], 2, "--sensor: expected 1 to 100 ASCII characters"),
    (["press", "--frames", "33", *NONE], 2, "a whole number from 1 to 32, found '33'"),
    (["press", "--gate", "of", *NONE], 2, "--gate: expected off, wait, refuse or best, found 'of'"),
    (["press", "--save", "x.doc", *NONE], 2, "x.doc: ending .doc, expected one of .ply .pcd"),
    (["press", "--address", "tcp://x"], 2, "tcp://x: expected ipc://PATH or tcp://HOST:PORT"),
    (["press", "--key", "d", "--hub-key", "d", "--address", "tcp://127.0.0.1:9"], 2,
     "d: is a folder, expected a file"),
    (["get", *NONE], 2, "one of the arguments ID --last is required"),
    (["get", "../x", *NONE], 2, CAPTURE_ID),
    (["list", "--last", "51", *NONE], 2, "expected a whole number from 1 to 50, found '51'"),
    (["subscribe", "--last", "0", *NONE], 2, f"--last: {WHOLE}1, found '0'"),
    (["subscribe", "--count", "9" * 30, *NONE], 2, f"--count: {WHOLE}1, found '999"),
    (["subscribe", "--after", "-1", *NONE], 2, f"--after: {WHOLE}0, found '-1'"),
    (["subscribe", "--since", "yesterday", *NONE], 2, f"--since: {TIME}'yesterday'"),
    (["subscribe", "--since", "2026-13-01", *NONE], 2, f"--since: {TIME}'2026-13-01'"),
    (["dead"], 2, "required: list|retry|drop"),
    (["dead", "bury"], 2, "list|retry|drop: expected list, retry or drop, found 'bury'"),
    (["dead", "list", "x", *NONE], 2, "list: expected neither ids nor --all"),
    (["dead", "retry", *NONE], 2, "retry: expected ids, or --all"),
    (["dead", "drop", "../x", *NONE], 2, CAPTURE_ID),
    (["purge"], 2, "one of the arguments --id --before --all is required"),
    (["purge", "--all", *NONE], 2, "--yes: expected, as there is nobody to ask"),
    (["purge", "--id", "../x", "--yes", *NONE], 2, CAPTURE_ID),
    (["purge", "--before", "noon", *NONE], 2, f"--before: {TIME}'noon'"),
    (["status", "--wait", "0", *NONE], 2, f"--wait: {SECONDS}'0'"),
    (["status", "--wait", "0.01", "--address", "ipc://{tmp}/f"], 1, "and it is no socket"),
    (["status", "--healthy", "x", *NONE], 2, "expected one of service, hub, sensor, worker, kiosk"),
    (["status", "--healthy", "sensor:", *NONE], 2, "or sensor:NAME, found 'sensor:'"),
    (["status", "--healthy", "hub", "--json", *NONE], 2, "expected neither --json nor --wait"),
    (["keys", "new", "../x"], 2, "key name '../x': expected letters, digits, - and _, at most 64"),
    (["keys", "new", "a", "--keys", "f"], 2, "f: is a file, expected a folder"),
    (["keys", "list", "--keys", "f"], 2, "f/allowed: lies in what is a file, expected a folder"),
    (["keys", "allow", "a", "none", "presser"], 2, "none: no such file, nor a key"),
    (["keys", "allow", "a", "d", "presser"], 2, "d: is a folder, expected a file"),
    (["keys", "allow", "a", "p", "presser"], 2, "p: Not a regular file"),
    (["keys", "allow", "a", "/dev/zero", "presser"], 2, "/dev/zero: Not a regular file"),
    (["keys", "revoke", "nobody"], 2, "nobody: no key of that name is allowed in "),
], ids=lambda given: " ".join(given)[:60] if isinstance(given, list) else "")
def test_one_clear_line_and_the_right_status(arguments, status, line, tmp_path, capfd):
    given = [one.replace("{tmp}", str(tmp_path)) for one in arguments]
    try:
        ended = main(given)
    except SystemExit as end:
        ended = end.code
    process_log.flush(LIMIT_S)
    out, said = capfd.readouterr()
    assert (ended, out, len(said.splitlines())) == (status, "", 1), said
    assert line in said
    command = arguments[0] if arguments[0] in COMMANDS else ""
    assert said.startswith(f"denseface {command}".rstrip())
    assert len(said) < 1000
