"""The page docs/reference/first-day.md, written from first_day.yaml of all drivers.

`python -m tests.docs.first_day_page` writes it.
"""

from collections.abc import Iterator
from pathlib import Path

from arcor2_hw.data.base import Unset
from arcor2_hw.testing import quality
from arcor2_hw.testing.first_day.declaration import FILE, FirstDay, read

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reference" / "first-day.md"
HEAD = """# First day: what is special about each device

After reading this page you know what [the first day with a real device](../how-to/first-hardware-day.md) asks for, by
device. None of it is a safety function. `python -m tests.docs.first_day_page` writes the page from `first_day.yaml` of
the drivers.
"""


def page() -> str:
    """Return the text of the page."""
    folders = sorted(path.parent for path in (ROOT / "drivers" / "arcor2_drivers").glob(f"*/{FILE}"))
    return HEAD + "".join("\n" + "\n".join(_of_a_driver(folder)) + "\n" for folder in folders)


def _of_a_driver(folder: Path) -> Iterator[str]:
    link = quality.read(folder / quality.FILE).page
    yield f"## {(ROOT / link).read_text().splitlines()[0].removeprefix('# ')}"
    yield ""
    yield f"See [the device](../{link.removeprefix('docs/')})."
    days: list[tuple[list[str], FirstDay]] = []
    for name, day in read(folder).items():
        same = next((names for names, other in days if other == day), None)
        if same is None:
            days.append(([name], day))
        else:
            same.append(name)
    for names, day in days:
        yield from ("", ", ".join(f"`{name}`" for name in names) + ":", "", *_of_a_type(day))


def _of_a_type(day: FirstDay) -> Iterator[str]:
    yield "| | |"
    yield "|---|---|"
    limits = [", ".join(f"`{name}`" for name in day.limits)] if day.limits else []
    for title, lines in (
        ("before it is connected", day.before),
        ("limits in its settings", limits),
        ("limits in the device", day.device_limits),
        ("before the driver takes control", day.ready),
        ("small motion", ["none is declared"] if isinstance(day.small, Unset) else [day.small.sentence]),
        ("full motion", ["none is declared"] if isinstance(day.full, Unset) else [day.full.sentence]),
    ):
        if lines:
            yield f"| {title} | {' '.join(lines)} |"


if __name__ == "__main__":
    PAGE.write_text(page())
