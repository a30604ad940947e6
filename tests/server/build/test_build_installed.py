"""Every installed driver can be packed: its folder is complete and needs nothing else."""

from pathlib import Path

import pytest

from arcor2_hw.analysis import InstalledType, installed_types, module_name
from arcor2_server.build.snapshot import files_of
from arcor2_server.object_types.catalog import PackageType


@pytest.mark.parametrize("found", installed_types(), ids=lambda found: found.name)
def test_an_installed_type_is_packed_with_its_own_folder(found: InstalledType) -> None:
    assert found.problem is None, found.problem
    one = PackageType(
        found.name,
        module_name(found.name),
        "",
        found.entry_point,
        Path(found.folder),
        found.distribution,
        found.version,
    )
    files = files_of([one], {})
    module, _, name = found.entry_point.partition(":")
    given = files[f"object_types/{one.module}.py"].decode()
    assert f"import {name} as {name}" in given
    assert any(path.endswith(f"/{module.rpartition('.')[2]}.py") for path in files)
