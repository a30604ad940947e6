"""Modules under the names of ARCOR2, so that sources written for it run unchanged after `install`.

The modules exist only in memory. They take precedence over installed modules of the same names.
"""

import importlib
import sys
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any, Final

from arcor2_hw.data.older_names import OLDER_NAMES, OLDER_PACKAGES, is_older, not_offered

__all__ = ["install"]


class _Finder(MetaPathFinder, Loader):
    """Find the modules in OLDER_NAMES. Each is a package, so that imports of missing submodules reach this finder."""

    def find_spec(
        self,
        fullname: str,
        path: Sequence[str] | None,  # noqa: ARG002 - required by the interface
        target: ModuleType | None = None,  # noqa: ARG002
    ) -> ModuleSpec | None:
        """Find a module of ARCOR2. Raises ImportError if it is not supported."""
        if not is_older(fullname):
            return None
        if fullname in OLDER_NAMES:
            return ModuleSpec(fullname, self, origin="arcor2_hw", is_package=True)
        raise ImportError(str(not_offered(fullname)), name=fullname)

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:  # noqa: ARG002
        """Return None, so that Python creates the module."""
        return None

    def exec_module(self, module: ModuleType) -> None:
        """Let the module look up each name on first use, so that only needed modules are imported."""
        names = OLDER_NAMES[module.__name__]

        def look_up(name: str) -> Any:
            if (submodule := f"{module.__name__}.{name}") in OLDER_NAMES:
                return importlib.import_module(submodule)  # `arcor2.data.common.Pose` after `import arcor2`
            try:
                place, ours = names[name]
            except KeyError:
                raise AttributeError(f"module {module.__name__!r} has no attribute {name!r}") from None
            found = getattr(importlib.import_module(place), ours)
            setattr(module, name, found)
            return found

        module.__dict__["__getattr__"] = look_up
        module.__dict__["__all__"] = sorted(names)
        module.__doc__ = f"Names that sources import from {module.__name__}."


_FINDER: Final = _Finder()


def install() -> None:
    """Make the modules of ARCOR2 importable in this process. Further calls do nothing."""
    if _FINDER in sys.meta_path:
        return
    for name in [name for name in sys.modules if name.partition(".")[0] in OLDER_PACKAGES]:
        del sys.modules[name]
    sys.meta_path.insert(0, _FINDER)
