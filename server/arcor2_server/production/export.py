"""Records of units as CSV."""

import csv
import io
from collections.abc import Iterable
from typing import Final

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.units import Unit
from arcor2_server.audit.export import as_cell

COLUMNS: Final = (
    *("number", "serial", "state", "verdict", "entered", "left", "order", "product", "revision", "recipe_id"),
    *("package_id", "package_name", "package_hash", "started_by", "runs"),
)


def units_as_csv(units: Iterable[Unit]) -> bytes:
    """Return units as CSV, one line each."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    for unit in units:
        recipe = unit.recipe
        values = {
            "state": unit.state.value,
            "verdict": {True: "passed", False: "failed", UNSET: ""}[unit.verdict],
            "product": "" if isinstance(recipe, Unset) else recipe.product,
            "revision": "" if isinstance(recipe, Unset) else recipe.revision,
            "recipe_id": "" if isinstance(recipe, Unset) else recipe.id,
            "left": "" if isinstance(unit.left, Unset) else unit.left,
            "runs": " ".join(map(str, unit.runs)),
        }
        writer.writerow(as_cell(values.get(name, getattr(unit, name, ""))) for name in COLUMNS)
    return text.getvalue().encode()
