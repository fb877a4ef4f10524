"""What the help shows at its end. Each example is read by a test as it stands."""

__all__ = ["EXAMPLES", "EXIT_STATUSES", "FIRST"]

FIRST = """\
what people do first:
  denseface reconstruct recording.oni -o face.ply   a face of a recording or a frame
  denseface doctor                                  is everything here that a sensor needs?
  denseface up                                      run the service; then, beside it:
  denseface press --save face.ply                   take a picture now"""

EXIT_STATUSES = """\
exit status:
  0 done; 1 failed, also where there is no face; 2 wrong usage, or a file that cannot be read;
  129, 130 and 143 after SIGHUP, Ctrl-C and SIGTERM; 141 where the reader of stdout left"""

EXAMPLES = {
    "reconstruct": "reconstruct recording.oni --frame 3 -o face.ply --preview face.png",
    "batch": "batch recordings/ --out faces/ --every 10",
    "view": "view recording.oni --frame 3",
    "compare": "compare before.oni after.oni -o report.html",
    "evaluate": "evaluate recording.oni --truth scan.ply -o evaluation/",
    "doctor": "doctor --source openni2:",
    "calibrate": "calibrate --infrared ir/ --color rgb/ --board 9x6 --square 24.5 "
                 "-o sensor.calibration.json",
    "live": "live --source openni2: --seconds 30",
    "record": "record take.oni --seconds 10",
    "export": "export face.npz -o face.3mf --solid mask --height 80",
    "info": "info face.ply recording.oni",
    "up": "up --source openni2: --workers 2 --retention 7d",
    "press": "press --save face.ply --report report.json",
    "get": "get 3f2a --save face.ply",
    "list": "list --last 5",
    "subscribe": "subscribe --save faces/ --last 10",
    "dead": "dead list",
    "purge": "purge --before 2026-01-31T14:30",
    "status": "status --wait 60",
    "keys": "keys new kiosk",
    "keys new": "keys new kiosk",
    "keys allow": "keys allow kiosk kiosk.public presser subscriber",
    "keys revoke": "keys revoke kiosk",
    "keys list": "keys list --keys /etc/denseface/keys",
    "hub": "hub --listen tcp://0.0.0.0:5555 --metrics 9100",
    "capture": "capture --source openni2: --name entrance",
    "warm": "warm",
    "install-units": "install-units --dry-run --workers 3",
    "bench": "bench --quick",
    "completion": "completion bash",
    "worker": "worker --address ipc:///run/denseface/hub",
    "kiosk": "kiosk --kiosk-address 8080",
    "help": "help press",
}
"""Command -> arguments of `denseface`."""
