"""Size of the files that the workplace needs."""

import json
from pathlib import Path
from typing import Any

import pytest

MAX_SHELL = 264_000
"""Largest size of shell and 3D view, compressed with gzip, bytes."""


MAX_AR = 25_000
"""Largest size of the files that an AR mode loads when it starts, compressed with gzip, bytes."""
_START = {"src/ui/ar/StartAr.tsx", "src/ui/ar/ArView.tsx"}
_ON_DEMAND = {"src/ui/ar/touching.ts"}
"""Parts of AR that are loaded when the user needs them: words and computations for touching points."""
AR_MODES = {
    "camera": ({"src/commands/cameraAr.ts", "src/ui/ar/ArControls.tsx"}, "worker"),
    "tablet": ({"src/ar/xrSession.ts", "src/ui/ar/ArControls.tsx"}, "xrWorker"),
    "headset": ({"src/ar/xrSession.ts", "src/ar/headset.ts", "src/ui/ar/HeadsetPanel.tsx"}, "xrWorker"),
}
"""Modules and worker of each AR mode. Headsets that provide no camera pictures do not load the worker."""


def needed(manifest: dict[str, Any], *names: str) -> set[str]:
    """Return the files of these modules and their static imports, with styles."""
    found: set[str] = set()
    waiting, seen = list(names), set()
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        chunk = manifest[name]
        found |= {chunk["file"], *chunk.get("css", [])}
        waiting += chunk.get("imports", [])
    return found


def ar_size(files: Path, manifest: dict[str, Any], mode: str) -> int:
    """Return the size of the files that only an AR mode loads at its start, bytes."""
    modules, worker = AR_MODES[mode]
    of_ar = _START.union(_ON_DEMAND, *(each for each, _ in AR_MODES.values()))
    others = {name for name, chunk in manifest.items() if chunk.get("isEntry") or chunk.get("isDynamicEntry")} - of_ar
    found = needed(manifest, *_START, *modules) - needed(manifest, *others)
    found |= {str(file.relative_to(files)) for file in (files / "assets").glob(f"{worker}-*.js")}
    return sum((files / f"{name}.gz").stat().st_size for name in found)


@pytest.mark.parametrize("mode", AR_MODES)
def test_files_of_an_ar_mode_are_below_the_size_limit(built_editor: Path, mode: str) -> None:
    manifest = json.loads((built_editor / ".vite" / "manifest.json").read_text())
    assert 10_000 < ar_size(built_editor, manifest, mode) <= MAX_AR


def test_shell_and_3d_view_are_below_the_size_limit(built_editor: Path) -> None:
    manifest = json.loads((built_editor / ".vite" / "manifest.json").read_text())
    files = needed(manifest, "index.html", "src/engine/engine.ts")
    sizes = {name: (built_editor / f"{name}.gz").stat().st_size for name in files}
    assert len(sizes) >= 3
    assert sum(sizes.values()) <= MAX_SHELL, sizes
    # Rarely used parts are loaded on demand.
    assert not needed(manifest, "src/engine/loaders/urdf.ts") <= files
    assert not needed(manifest, "src/ui/settings/SettingsMenu.tsx") <= files
    assert not needed(manifest, "src/ui/join/Join.tsx") <= files
