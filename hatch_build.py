"""Compile the kernel when the package is built or installed; see src/brachis/kernel/compile.py."""

from __future__ import annotations

import importlib.util
import platform
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

ROOT = Path(__file__).parent


def _load_compiler() -> Any:
    """Import compile.py by its file: the package itself is not installed yet."""
    path = ROOT / "src/brachis/kernel/compile.py"
    spec = importlib.util.spec_from_file_location("compile_kernel", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class KernelHook(BuildHookInterface):  # type: ignore[type-arg]
    """Compile the kernel, and mark the wheel as one for this kind of machine and for every Python."""

    def dependencies(self) -> list[str]:
        """Return the package that brings a C compiler, where the machine has none."""
        return [] if _load_compiler().find_compiler() else ["ziglang>=0.13"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile."""
        for library in _load_compiler().compile_kernel():
            build_data["artifacts"].append(str(library.relative_to(ROOT)))
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{_platform_tag()}"


def _platform_tag() -> str:
    """Return the tag of this kind of machine; on macOS of its own processor alone, for which the compiler compiles."""
    name = sysconfig.get_platform()
    if name.startswith("macosx"):
        name = f"macosx-11.0-{platform.machine()}"
    return name.replace("-", "_").replace(".", "_")
