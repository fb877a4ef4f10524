"""Dockerfile and compose.yaml fit the code, the lock and each other; tests/container runs them."""

import json
import re
import subprocess
from pathlib import Path

import pytest
import yaml

from denseface.service.cli import _parser
from denseface.service.kiosk.settings import KioskSettings
from denseface.service.settings import ServiceSettings
from denseface.service.transport.addresses import is_local, socket_file

REPOSITORY = Path(__file__).resolve().parents[2]
SECRETS = {"apt.conf", "sources.list", "pip.conf", "npmrc", "ca.crt"}


def instructions() -> list[tuple[str, str]]:
    """Give the words of the Dockerfile, each with all that follows it."""
    text = re.sub(r"^#.*\n", "", (REPOSITORY / "Dockerfile").read_text(), flags=re.MULTILINE)
    return [(word, rest.strip()) for word, _, rest in (
        line.partition(" ") for line in text.replace("\\\n", " ").splitlines() if line)]


ALL = instructions()
FINAL = ALL[max(i for i, (word, _) in enumerate(ALL) if word == "FROM"):]


def of(word: str, where: list[tuple[str, str]] = FINAL) -> list[str]:
    return [rest for one, rest in where if one == word]


ENVIRONMENT = dict(one.split("=", 1) for line in of("ENV") for one in line.split())
COMPOSE = yaml.safe_load((REPOSITORY / "compose.yaml").read_text())
SERVICES = COMPOSE["services"]


def filled(text: str) -> str:
    """Give a value of compose.yaml where no variable is set."""
    return re.sub(r"\$\{\w+:-(.*?)\}", r"\1", text)


def settings_of(environment: dict[str, str]) -> None:
    """Refuse names that are no settings, and values that are wrong."""
    own = {name: filled(value) for name, value in environment.items()
           if name.startswith("DENSEFACE_")}
    known = ({f"DENSEFACE_{one.upper()}" for one in ServiceSettings.model_fields}
             | {f"DENSEFACE_KIOSK_{one.upper()}" for one in KioskSettings.model_fields})
    assert own.keys() <= known
    ServiceSettings.of(own)
    KioskSettings.of(own)


# --- the Dockerfile

def test_both_stages_stand_on_one_base_that_can_be_pinned():
    assert of("FROM", ALL) == ["${BASE} AS build", "${BASE}"]
    assert ALL[0] == ("ARG", "BASE=debian:12-slim")


def test_what_is_installed_is_in_a_lock_with_hashes():
    runs = " ".join(of("RUN", ALL))
    fetching = re.findall(r"pip (?:install|wheel) [^&]*", runs)
    assert len(fetching) >= 2
    for one in fetching:
        assert "--require-hashes" in one or "--no-index" in one or one.startswith(
            "pip wheel --no-deps --no-build-isolation"), one
    named = set(re.findall(r"requirements/[\w$]+\.txt", runs))
    assert named == {"requirements/build.txt", "requirements/$LOCK.txt"}
    assert set(of("ARG", ALL)[1:]) == {"LOCK=image"}
    assert (REPOSITORY / "requirements/image.txt").is_file()


def test_no_word_but_the_commands_own_is_in_the_final_image():
    installed, = re.findall(r"apt-get install -y --no-install-recommends (.*?)&&",
                            " ".join(of("RUN")))
    assert not set(installed.split()) & {"gcc", "g++", "binutils", "python3-pip", "python3-venv"}
    assert of("COPY") == ["--from=build /opt/denseface /opt/denseface"]


def test_secrets_are_those_that_the_script_gives():
    asked = set(re.findall(r"type=secret,id=([\w.]+)", " ".join(of("RUN", ALL))))
    given, = re.findall(r"for secret in (.*); do", (REPOSITORY / "script/image").read_text())
    assert asked == set(given.split()) == SECRETS
    assert not re.search("(?i)proxy|index.?url|mirror|PIP_CERT", "".join(of("ENV", ALL)))


def test_the_image_s_own_words_are_commands():
    entry, command = (json.loads(one) for one in (*of("ENTRYPOINT"), *of("CMD")))
    assert entry[-1] == "denseface"
    assert _parser.parse(command).command == "up"
    check, = re.findall(r"CMD (\[.*\])", of("HEALTHCHECK")[0])
    program, *arguments = json.loads(check)
    assert program == "denseface"
    assert _parser.parse(arguments).healthy == "service"


def test_any_user_may_write_where_it_is_to_and_nowhere_else():
    settings_of(ENVIRONMENT)
    assert re.fullmatch(r"[1-9]\d*:0", *of("USER"))
    places = re.findall(r"install -d -m 1777 (.*)", " ".join(of("RUN")))[0].split()
    assert {*of("VOLUME")[0].split(), *of("WORKDIR"), ENVIRONMENT["HOME"]} <= set(places)
    # Its parent, not the volume itself, which is everybody's: the hub makes a folder of its own.
    assert str(Path(ENVIRONMENT["DENSEFACE_DATA"]).parent) in places


def test_the_port_is_the_page_s():
    assert of("EXPOSE") == [str(KioskSettings().address[1])]


def test_what_the_build_needs_is_sent_to_it():
    sent = {line[1:] for line in (REPOSITORY / ".dockerignore").read_text().splitlines()
            if line.startswith("!")}
    needed = {"requirements", "distributions", "script/build_frontend.py"}
    for link in (REPOSITORY / "distributions/core").iterdir():
        # A source archive alone has the recordings.
        if link.is_symlink() and link.name not in ("script", "fixtures"):
            needed.add(str(link.resolve().relative_to(REPOSITORY)))
    needed |= {str(one.resolve().relative_to(REPOSITORY))
               for one in (REPOSITORY / "denseface").iterdir() if one.is_symlink()}
    assert needed == sent


# --- compose.yaml

@pytest.mark.parametrize("name", SERVICES)
def test_a_service_runs_a_process_as_the_image_has_it(name):
    service = SERVICES[name]
    assert _parser.parse([filled(one) for one in service["command"]]).command == name
    program, *arguments = service["healthcheck"]["test"][1:]
    assert program == "denseface"
    health = _parser.parse(arguments)
    assert (health.command, health.healthy) == (
        "status", {"capture": "sensor"}.get(name, name))
    settings_of(ENVIRONMENT | service["environment"])


def test_the_services_are_the_four_processes():
    assert set(SERVICES) == {"hub", "capture", "worker", "kiosk"}


@pytest.mark.parametrize("name", SERVICES)
def test_a_service_may_do_no_more_than_it_needs(name):
    service = SERVICES[name]
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert not {"privileged", "cap_add", "pid", "ipc"} & service.keys()
    assert (service.get("network_mode") == "none") == (name != "kiosk")
    assert ("device_cgroup_rules" in service) == (name == "capture")
    assert service["deploy"]["resources"]["limits"].keys() == {"memory", "pids"}


def test_all_speak_over_one_socket_file_as_one_user():
    addresses = {one["environment"]["DENSEFACE_ADDRESS"] for one in SERVICES.values()}
    address, = addresses
    assert is_local(address)
    path = socket_file(address)
    assert path is not None
    # The hub makes a folder of its own in the volume.
    shared = {f"run:{path.parent.parent}" in one["volumes"] for one in SERVICES.values()}
    assert shared == {True}
    user, = {filled(one["user"]) for one in SERVICES.values()}
    assert user == of("USER")[0]


def test_faces_are_in_the_hub_s_volumes_alone():
    volumes = {name: {one.partition(":")[0] for one in service["volumes"]}
               for name, service in SERVICES.items()}
    assert set().union(*volumes.values()) - {"/dev/bus/usb"} == set(COMPOSE["volumes"])
    for name, own in volumes.items():
        assert ("hub" in own) == ("faces" in own) == (name == "hub")


def test_the_page_is_published_on_the_loopback_alone():
    host, outside, inside = SERVICES["kiosk"]["ports"][0].split(":")
    environment = {name: filled(value) for name, value in SERVICES["kiosk"]["environment"].items()}
    settings = KioskSettings.of(environment)
    assert (host, int(inside)) == ("127.0.0.1", settings.address[1])
    assert settings.proxy == (f"http://localhost:{outside}",)


def test_the_hub_s_memory_is_more_than_it_sets_itself():
    limit = SERVICES["hub"]["deploy"]["resources"]["limits"]["memory"]
    assert int(limit.removesuffix("g")) * 1024 > ServiceSettings().memory_mb


@pytest.mark.parametrize("arguments", [["--chekc"], ["image"]])
def test_a_wrong_argument_of_the_script_is_one_line(arguments):
    done = subprocess.run([REPOSITORY / "script/image", *arguments], check=False, text=True,
                          capture_output=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"image: unknown argument: {arguments[0]}\n"
