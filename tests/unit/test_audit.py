"""What script/audit makes of what it is told."""

import json
import subprocess
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest

_SCRIPT = Path(__file__).resolve().parents[2] / "script" / "audit"


@pytest.fixture(scope="module")
def audit():
    loader = SourceFileLoader("audit", str(_SCRIPT))
    module = module_from_spec(spec_from_loader("audit", loader))
    loader.exec_module(module)
    return module


@pytest.mark.parametrize(("expression", "allowed"), [
    ("MIT", True),
    ("BSD-3-Clause AND (0BSD AND Zlib)", True),
    ("GPL-3.0-or-later OR Apache-2.0", True),
    ("MIT AND LGPL-2.1", False),
    ("GNU General Public License v3 (GPLv3)", False),
    ("unknown", False),
])
def test_licences(audit, expression, allowed):
    assert audit.is_allowed(expression) is allowed


def test_what_tests_alone_may_use_is_not_handed_out(audit):
    lock = (_SCRIPT.parents[1] / "requirements" / "run.txt").read_text()
    assert "numpy==" in lock
    for name in audit._TESTS_ALONE:
        assert f"\n{name}==" not in lock


def _answering(monkeypatch, *outputs):
    left = list(outputs)
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: subprocess.CompletedProcess(
        [], 1, left.pop(0)))
    return left


_NOT_THERE = json.dumps({"dependencies": [{"name": "a", "skip_reason": "a is not there"}]})
_KNOWN = json.dumps({"dependencies": [
    {"name": "a", "version": "1", "vulns": [{"id": "V-1", "fix_versions": ["2"]}]},
    {"name": "b", "version": "1", "vulns": []}, {"name": "c", "skip_reason": "c is not there"}]})


def test_a_vulnerability_is_named_with_its_cure(audit, monkeypatch):
    left = _answering(monkeypatch, _KNOWN, "not asked")
    assert audit.vulnerabilities() == ["a 1: V-1, fixed in 2", "not audited: c is not there"]
    assert left == ["not asked"]


def test_another_service_is_asked_where_one_knows_nothing(audit, monkeypatch):
    _answering(monkeypatch, _NOT_THERE, _KNOWN)
    assert audit.vulnerabilities()


def test_no_service_is_not_no_vulnerability(audit, monkeypatch):
    _answering(monkeypatch, _NOT_THERE, "")
    assert audit.vulnerabilities() is None


_OF_NPM = json.dumps({"vulnerabilities": {
    "a": {"range": "<2", "via": [{"url": "https://example.org/V-1"}]},
    "b": {"range": "*", "via": ["a"]}}})
_NOTHING = json.dumps({"vulnerabilities": {}})


@pytest.mark.parametrize(("answers", "known"), [
    ((_OF_NPM, _NOTHING), ["a <2: https://example.org/V-1"]),
    ((_NOTHING, _OF_NPM), ["a <2: https://example.org/V-1"]),
    ((_NOTHING, _NOTHING), []),
    ((json.dumps({"message": "405 Method Not Allowed"}),), None),
    ((_OF_NPM, ""), None),
])
def test_of_npms_packages_too(audit, monkeypatch, answers, known):
    left = _answering(monkeypatch, *answers)
    assert audit.npm_vulnerabilities() == known
    assert not left


def test_npms_packages_have_licences_that_are_allowed(audit):
    licences = audit.npm_licences()
    assert licences["three"] == "MIT"
    assert licences["zeromq"] == "MIT AND MPL-2.0"
    assert not {name: text for name, text in licences.items() if not audit.is_allowed(text)}
