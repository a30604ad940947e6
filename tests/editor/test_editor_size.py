"""Size of the files that the workplace needs."""

import json
from pathlib import Path
from typing import Any

MOST = 264_000
"""Largest size of shell and 3D view, compressed with gzip, bytes."""


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


def test_shell_and_3d_view_are_small(built_editor: Path) -> None:
    manifest = json.loads((built_editor / ".vite" / "manifest.json").read_text())
    files = needed(manifest, "index.html", "src/engine/engine.ts")
    sizes = {name: (built_editor / f"{name}.gz").stat().st_size for name in files}
    assert len(sizes) >= 3
    assert sum(sizes.values()) <= MOST, sizes
    # Rarely used parts are loaded on demand.
    assert not needed(manifest, "src/engine/loaders/urdf.ts") <= files
    assert not needed(manifest, "src/ui/settings/SettingsMenu.tsx") <= files
    assert not needed(manifest, "src/ui/join/Join.tsx") <= files
