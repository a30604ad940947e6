"""What a tablet has to load before it shows the workplace."""

import json
from pathlib import Path
from typing import Any

MOST = 260_000
"""Bytes of the shell and the 3D view, compressed with gzip."""


def needed(manifest: dict[str, Any], *names: str) -> set[str]:
    """The files of these modules and of all that they import at once, styles too."""
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
    # What few need comes only to them.
    assert not needed(manifest, "src/engine/loaders/urdf.ts") <= files
    assert not needed(manifest, "src/ui/kit/menu.tsx") <= files
