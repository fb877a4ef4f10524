"""What script/build_examples.py makes, when, and what it says where it cannot."""

import importlib.util
from pathlib import Path

import pytest

_SCRIPT = Path(__file__).resolve().parents[2] / "script" / "build_examples.py"


@pytest.fixture
def builder(tmp_path, monkeypatch):
    """With an example in C++ of its own, and a shell for its compiler."""
    spec = importlib.util.spec_from_file_location("build_examples", _SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(module, "EXAMPLES", tmp_path)
    monkeypatch.setattr(module, "COMPILE", "sh press.cpp")
    for name in ("cpp", "javascript"):
        (tmp_path / name).mkdir()
    return module


def write(builder, text):
    (builder.EXAMPLES / "cpp" / "press.cpp").write_text(text)


def test_it_is_made_anew_where_a_source_changed_and_only_then(builder):
    write(builder, "echo one >press")
    first = builder.cpp_program()
    assert first.read_text() == "one\n"
    first.write_text("left alone")
    assert builder.cpp_program().read_text() == "left alone"
    write(builder, "echo two >press")
    assert builder.cpp_program().read_text() == "two\n"


@pytest.mark.parametrize(("said", "why"), [
    ("face.hpp:9:10: fatal error: zmq.hpp: No such file or directory", "zmq.hpp is not installed"),
    ("/usr/bin/ld: cannot find -lzmq: No such file or directory", "-lzmq is not installed"),
])
def test_a_library_that_is_missing_is_named(builder, said, why):
    write(builder, f"echo '{said}'\nexit 1")
    with pytest.raises(builder.MissingToolError, match=f"^{why}"):
        builder.cpp_program()


def test_a_mistake_in_the_program_is_no_missing_tool(builder):
    """Else the tests would be skipped in place of failing."""
    write(builder, "echo 'error: expected ;'\nexit 1")
    with pytest.raises(builder.ExampleError, match="expected ;") as caught:
        builder.cpp_program()
    assert type(caught.value) is builder.ExampleError
    assert not list((builder.ROOT / "build/examples").iterdir())


def test_a_compiler_that_is_missing_is_named(builder, monkeypatch):
    write(builder, "")
    monkeypatch.setattr(builder, "COMPILE", "no-such-compiler press.cpp")
    with pytest.raises(builder.MissingToolError, match="there is no no-such-compiler"):
        builder.cpp_program()


def test_the_tests_install_nothing(builder):
    for name in ("package.json", "package-lock.json"):
        (builder.EXAMPLES / "javascript" / name).write_text("{}")
    with pytest.raises(builder.MissingToolError, match="script/bootstrap --tests"):
        builder.javascript_packages(install=False)
