"""The compiled library: where it is missing or belongs to other source, the message says so and what to do."""

import ctypes
import shutil

import numpy as np
import pytest

import brachis
from brachis.errors import NotBuiltError
from brachis.kernel import Spline, library
from brachis.kernel import compile as compiling


@pytest.fixture
def built(tmp_path):
    """Copies of the library and its record, which a test may damage."""
    library_file = compiling.library_path("baseline")
    for file in (library_file, library_file.with_suffix(".sha256")):
        shutil.copy(file, tmp_path)
    return tmp_path / library_file.name


@pytest.mark.parametrize("suffix", [".so", ".sha256"])
def test_a_missing_library(built, suffix):
    built.with_suffix(suffix).unlink()
    missing = rf"not built: .*No such file.*kernel_baseline{suffix}'"
    with pytest.raises(NotBuiltError, match=rf"{missing}. Run python \S*/compile\.py"):
        library._open(built)


@pytest.mark.parametrize("change", ["truncated", "other"])
def test_a_damaged_library_does_not_load(built, change, monkeypatch):
    content = built.read_bytes()
    changed = {"truncated": content[:9000], "other": content[:-1] + b"?"}[change]
    built.write_bytes(changed)
    monkeypatch.delattr(ctypes, "CDLL")  # loading it might end the interpreter
    sizes = f"it has {len(changed)} bytes, .* instead of {len(content)} bytes"
    with pytest.raises(NotBuiltError, match=f"damaged: {sizes}"):
        library._open(built)


def test_a_file_that_is_no_library(built):
    built.write_bytes(b"no library")
    built.with_suffix(".sha256").write_text(compiling.describe_file(built))
    with pytest.raises(NotBuiltError, match=r"not built: .*kernel_baseline\.so: "):
        library._open(built)


def test_a_library_of_other_source(built, monkeypatch):
    monkeypatch.setattr(library, "source_digest", lambda: "0123")
    with pytest.raises(NotBuiltError, match="other source"):
        library._open(built)


def test_all_variants_give_the_same_digits(monkeypatch):
    paths = [library.library_path(variant) for variant in ("baseline", "avx2")]
    made = [library._open(path) for path in paths if path.exists()]
    if not (len(made) == 2 and made[0].brachis_has_avx2()):
        pytest.skip("there is no other variant, or not for this processor")
    chain = brachis.robots.iiwa14.chain
    states = np.random.default_rng(0).normal(size=(3, 50, chain.n))
    found = []
    for own in made:
        monkeypatch.setattr(library, "load", lambda own=own: own)
        parts = [*chain.torque_derivatives(*states), chain.torques(*states)]
        parts += chain.tool(states[0], in_tool_axes=True)
        spline = Spline.through(np.linspace(0.0, 1.0, 50), states[0])
        parts += [spline.control_points, spline(np.linspace(0.0, 1.0, 99))]
        found.append(np.concatenate([part.ravel() for part in parts]))
    assert np.array_equal(found[0], found[-1])


def test_the_message_quotes_a_compiler_that_fails(tmp_path, monkeypatch):
    (tmp_path / "broken.c").write_text("this is no C")
    monkeypatch.setattr(compiling, "FOLDER", tmp_path)
    monkeypatch.setenv("CC", "false")
    with pytest.raises(RuntimeError, match="the C compiler fails: false"):
        compiling.compile_kernel()
    assert not list(tmp_path.glob("*.tmp"))


def test_no_compiler_at_all(monkeypatch):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(compiling.shutil, "which", lambda _name: None)
    monkeypatch.setattr(compiling.importlib.util, "find_spec", lambda _name: None)
    with pytest.raises(RuntimeError, match=r"no C compiler.*pip install ziglang"):
        compiling.compile_kernel()


def test_a_compiler_that_is_not_there(monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(RuntimeError, match="the C compiler cannot be run"):
        compiling.compile_kernel()
