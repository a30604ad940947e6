"""Preparation before the devices of a scene or package are created."""

import importlib
from types import ModuleType

import pytest

from arcor2_hw.data.scene import Scene
from arcor2_hw.objects import Camera, Generic, Robot
from arcor2_hw.runtime.cell import recipes


@pytest.mark.parametrize(("cls", "imported"), [(Robot, ["numpy"]), (Camera, ["numpy"]), (Generic, [])])
def test_numpy_is_imported_before_devices_connect(
    cls: type[Generic], imported: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    names: list[str] = []

    def record(name: str) -> ModuleType:
        names.append(name)
        return ModuleType(name)

    monkeypatch.setattr(importlib, "import_module", record)
    assert recipes(Scene("scene"), {cls.__name__: cls}, {}) == []
    assert names == imported
