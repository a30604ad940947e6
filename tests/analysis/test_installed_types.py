"""Object types of installed distributions are found and read, and never imported."""

import site
import sys
import textwrap
from pathlib import Path

import pytest
from msgspec import UNSET

from arcor2_hw.analysis import Library, SourceFile, installed_types
from arcor2_hw.analysis.installed import find_new_distributions, installation_stamp

POISON = "raise RuntimeError('this was imported')\n"

FILES = {
    "vendor_cell/__init__.py": POISON,
    "vendor_cell/common/__init__.py": "from .limits import TOP\n",
    "vendor_cell/common/limits.py": POISON + "TOP = 0.25\n",
    "vendor_cell/arm/__init__.py": POISON,
    "vendor_cell/arm/settings.py": """
        from dataclasses import dataclass
        from arcor2_hw.objects import Settings
        @dataclass
        class ArmSettings(Settings):
            host: str
            port: int = 30004
    """,
    "vendor_cell/arm/modes.py": """
        from arcor2_hw.actions import StrEnum
        class Grip(StrEnum):
            SOFT = "soft"
            HARD = "hard"
    """,
    "vendor_cell/arm/base.py": """
        from arcor2_hw.actions import action
        from arcor2_hw.objects import Robot
        from vendor_cell.common import TOP
        from .modes import Grip
        from .settings import ArmSettings
        class Base(Robot):
            def __init__(self, obj_id: str, name: str, pose, settings: ArmSettings) -> None: ...
            @action
            def grip(self, how: Grip = Grip.SOFT, speed: float = TOP, *, an: str | None = None) -> Grip: ...
    """,
    "vendor_cell/arm/arm.py": POISON
    + textwrap.dedent("""
        import vendor_sdk
        from .base import Base
        class Arm(Base):
            '''An arm.'''
            _ABSTRACT = False
            def stop(self) -> None:
                vendor_sdk.stop()
    """),
    "vendor_cell-1.2.dist-info/METADATA": "Metadata-Version: 2.1\nName: vendor-cell\nVersion: 1.2\n",
    "vendor_cell-1.2.dist-info/entry_points.txt": """
        [arcor2_hw.object_types]
        Arm = vendor_cell.arm.arm:Arm
        Gone = vendor_cell.arm.gone:Gone
        Nowhere = no_such_package_at_all.thing:Nowhere
    """,
}


@pytest.fixture
def distribution(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name, text in FILES.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(textwrap.dedent(text))
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def test_a_driver_of_several_files_is_read_without_importing(distribution: Path) -> None:
    found = {each.name: each for each in installed_types()}
    arm = found["Arm"]
    assert (arm.entry_point, arm.distribution, arm.version) == ("vendor_cell.arm.arm:Arm", "vendor-cell", "1.2")
    assert arm.folder == str(distribution / "vendor_cell" / "arm")
    assert arm.file is not None
    library = Library([arm.file])
    analysis = library.analyse("Arm")
    assert analysis.problem is None, analysis.problem
    assert analysis.meta.base == "Robot"  # Base is not a type for clients
    assert [s.name for s in analysis.meta.settings] == ["host", "port"]
    grip = analysis.actions[0]
    assert (grip.name, grip.origins, grip.disabled) == ("grip", UNSET, False)
    assert [p.default_value for p in grip.parameters] == ['"soft"', "0.25"]
    assert analysis.implemented == {"stop"}
    # Each file comes after the files that it imports.
    assert [each.module for each in analysis.modules] == [
        "vendor_cell.common.limits",
        "vendor_cell.common",
        "vendor_cell.arm.modes",
        "vendor_cell.arm.settings",
        "vendor_cell.arm.base",
    ]
    assert not [name for name in sys.modules if name.startswith("vendor_cell")]


def test_an_uploaded_type_may_derive_from_an_installed_one(distribution: Path) -> None:
    files = [each.file for each in installed_types() if each.file is not None]
    mine = "from vendor_cell.arm.arm import Arm\nclass Mine(Arm):\n    pass\n"
    analysis = Library([*files, SourceFile("Mine", "mine", mine)]).analyse("Mine")
    assert analysis.problem is None
    assert analysis.bases == ("Arm", "Robot", "GenericWithPose", "Generic")
    assert (analysis.actions[0].name, analysis.actions[0].origins) == ("grip", "Arm")


@pytest.mark.parametrize(("name", "text"), [("Gone", "vendor_cell.arm.gone"), ("Nowhere", "no_such_package_at_all")])
def test_an_entry_point_without_target_is_a_problem(distribution: Path, name: str, text: str) -> None:
    (found,) = [each for each in installed_types() if each.name == name]
    assert found.file is None
    assert found.problem is not None
    assert text in found.problem.what.text


def test_a_file_that_changed_is_read_again(distribution: Path) -> None:
    path = distribution / "vendor_cell" / "arm" / "arm.py"
    first = {each.name: each.file for each in installed_types()}["Arm"]
    path.write_text("class Arm: ...\n")
    second = {each.name: each.file for each in installed_types()}["Arm"]
    assert first is not None
    assert second is not None
    assert first.source != second.source == b"class Arm: ...\n"


def test_all_installed_types_are_valid() -> None:
    found = installed_types()
    library = Library(each.file for each in found if each.file is not None)
    assert {"CounterActions", "FlowActions", "LogicActions", "RandomActions", "TimeActions"} <= {e.name for e in found}
    for each in found:
        assert each.problem is None, each.problem
        analysis = library.analyse(each.name)
        assert analysis.problem is None, analysis.problem
        assert not [(a.name, a.problem) for a in analysis.actions if a.disabled], each.name


def test_jog_and_acknowledge_features_of_installed_robots() -> None:
    library = Library([found.file for found in installed_types() if found.file is not None])
    features = {name: library.analyse(name).robot for name in ("UR5e", "YuMi")}
    assert features["UR5e"] is not None
    assert features["UR5e"].features.jog is True
    assert features["UR5e"].features.acknowledge_stop is True
    assert features["UR5e"].features.kinematic_calibration is True
    assert features["YuMi"] is not None
    assert features["YuMi"].features.acknowledge_stop is True
    assert features["YuMi"].features.kinematic_calibration is UNSET


def test_an_editable_installation_is_found_by_a_process_that_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packages, checkout = tmp_path / "site-packages", tmp_path / "checkout"
    packages.mkdir()
    monkeypatch.setattr(sys, "path", [*sys.path, str(packages)])
    monkeypatch.setattr(site, "getsitepackages", lambda: [str(packages)])
    before = installation_stamp()
    for name, text in FILES.items():
        path = (packages if "dist-info" in name else checkout) / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(textwrap.dedent(text))
    (packages / "__editable__.vendor_cell.pth").write_text(f"{checkout}\n")
    assert installation_stamp() != before
    assert {each.name: each for each in installed_types()}["Arm"].file is None
    find_new_distributions()
    arm = {each.name: each for each in installed_types()}["Arm"]
    assert arm.folder == str(checkout / "vendor_cell" / "arm")
