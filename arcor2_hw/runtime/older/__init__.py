"""Sources written for ARCOR2 run unchanged: what they import is ours, in this process, once `install` was called.

The modules exist only in memory. They come before installed ones of the same names, which are never looked at.
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
    """Finds the modules of the table. Each counts as a package: so a name that one lacks is asked for here too."""

    def find_spec(
        self,
        fullname: str,
        path: Sequence[str] | None,  # noqa: ARG002 - the signature of every finder
        target: ModuleType | None = None,  # noqa: ARG002
    ) -> ModuleSpec | None:
        """Find a module of ARCOR2; ImportError, saying what there is, for one that is not offered."""
        if not is_older(fullname):
            return None
        if fullname in OLDER_NAMES:
            return ModuleSpec(fullname, self, origin="arcor2_hw", is_package=True)
        raise ImportError(not_offered(fullname), name=fullname)

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:  # noqa: ARG002
        """Leave it to Python to make the module."""
        return None

    def exec_module(self, module: ModuleType) -> None:
        """Make the module look up its names on first use, since not every source needs all that they import."""
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
        module.__doc__ = f"What sources import from {module.__name__}."


_FINDER: Final = _Finder()


def install() -> None:
    """Make the modules of ARCOR2 importable in this process; done once, however often it is called."""
    if _FINDER in sys.meta_path:
        return
    for name in [name for name in sys.modules if name.partition(".")[0] in OLDER_PACKAGES]:
        del sys.modules[name]
    sys.meta_path.insert(0, _FINDER)
