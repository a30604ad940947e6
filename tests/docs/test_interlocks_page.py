"""The page about interlocks: its driver is understood, and its table names the observations of the drivers."""

import re
from pathlib import Path

from arcor2_hw.analysis import Library, SourceFile, installed_types
from arcor2_hw.data.object_type import ObservationMeta

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "interlocks.md").read_text()
DRIVER, CLIENT = re.findall(r"^```python\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


def test_the_driver_of_the_page_has_an_observation() -> None:
    analysis = Library([SourceFile("Door", "door", DRIVER)]).analyse("Door")
    assert analysis.problem is None
    assert analysis.meta.observations == [ObservationMeta("open", "boolean", "Return whether the door is open.")]


def test_the_table_names_the_observations_of_the_drivers() -> None:
    installed = installed_types()
    library = Library(each.file for each in installed if each.file is not None)
    metas = [library.analyse(each.name).meta for each in installed]
    named = {meta.shown_name: sorted(one.name.replace("_", " ") for one in meta.observations or ()) for meta in metas}
    rows = dict(re.findall(r"^\| ([A-Z][^|]+) \| ([a-z, ]+) \|$", PAGE, re.MULTILINE))
    shown = {name: sorted(values.split(", ")) for name, values in rows.items()}
    assert shown == {name: values for name, values in named.items() if values}
