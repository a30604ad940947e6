"""Build time as a function of the number of actions: storage, code generation, files and rename."""

import asyncio
import re
import tempfile
import time
from pathlib import Path
from typing import Any, Final

import msgspec
from msgspec.structs import replace

from arcor2_hw.data.geometry import Orientation, Position
from arcor2_hw.data.object_type import ObjectTypeSource
from arcor2_hw.data.project import (
    END,
    START,
    Action,
    ActionParameter,
    ActionParameterType,
    ActionPoint,
    Flow,
    FunctionReturns,
    LogicItem,
    NamedOrientation,
    Project,
    ProjectFunction,
    ProjectLogicIf,
)
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_server.build.combined_types import CombinedTypes
from arcor2_server.build.reading import from_script
from arcor2_server.build.script import from_logic
from arcor2_server.build.service import BuildInput, BuildService
from arcor2_server.object_types.catalog import KnownTypes
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import AssetStore, Storage
from benchmarks.metrics import Metric, Report, median

SIZES: Final = (250, 500, 1000, 2000, 10_000)
ROUNDS: Final = 9
_SOURCE: Final = '''"""A machine for builds; never run."""

from arcor2_hw.actions import action
from arcor2_hw.data.geometry import Pose
from arcor2_hw.objects import Generic


class Bench(Generic):
    """A machine."""

    _ABSTRACT = False

    @action
    def move(self, pose: Pose, speed: float = 0.5, *, an: str | None = None) -> None:
        """Move."""
        assert 0.0 <= speed <= 1.0

    @action
    def test(self, *, an: str | None = None) -> bool:
        """Test."""
        return True
'''
_SCENE: Final = Scene("bench", objects=[SceneObject("bench", "Bench", id="obj_bench")], id="scn_bench")


def blocks(first: int, last: int, name: str) -> tuple[list[Action], list[LogicItem]]:
    """Return the actions with these numbers, in blocks of four: a test, its two branches, and their join."""
    actions, logic = [], [LogicItem(START, f"act_{first}", id=f"lit_start_{name}")]
    for n in range(first, last):
        group, place = divmod(n - first, 4)
        if place == 0:
            parameters: list[ActionParameter] = []
        else:
            parameters = [
                ActionParameter("pose", "pose", '"ori_bench"'),
                ActionParameter("speed", "double", "0.25"),
            ]
        flow = Flow(outputs=[f"passed_{group}"] if place == 0 else [])
        method = "move" if place else "test"
        actions.append(Action(f"action {n}", f"obj_bench/{method}", f"act_{n}", parameters, [flow]))
        after = {0: (1, 2), 1: (2,), 2: (1,), 3: (1,)}[place]
        for branch, step in enumerate(after):
            end = f"act_{n + step}" if n + step < last else END
            when: Any = (
                ProjectLogicIf(f"act_{n}/default/0", "false" if branch else "true") if place == 0 else msgspec.UNSET
            )
            logic.append(LogicItem(f"act_{n}", end, when, f"lit_{n}_{branch}"))
    return actions, logic


def project(size: int) -> Project:
    """Return a project of `size` actions and calls. Half of the actions are in functions of 100, each called twice."""
    count = size // 200
    own = size - 100 * count - 2 * count
    actions, logic = blocks(0, own, "program")
    functions = []
    before = f"act_{own - 1}"
    logic[:] = [item for item in logic if item.start != before]
    for number in range(count):
        begin = own + 100 * number
        inner, inner_logic = blocks(begin, begin + 100, f"f{number}")
        parameter = ActionParameter("speed", ActionParameterType.FUNCTION_PARAMETER, '"speed"')
        inner[1].parameters[1] = parameter
        declared = [ActionParameter("speed", "double", "")]
        returns = [FunctionReturns("boolean", f"act_{begin}/default/0")]
        functions.append(ProjectFunction(f"step_{number}", inner, inner_logic, declared, returns, f"pfu_{number}"))
        for call in (f"call_{number}_{part}" for part in range(2)):
            given = [ActionParameter("speed", "double", "0.25")]
            actions.append(Action(call, f"pfu_{number}/call", f"act_{call}", given, [Flow(outputs=[f"good_{call}"])]))
            logic.append(LogicItem(before, f"act_{call}", id=f"lit_{call}"))
            before = f"act_{call}"
    logic.append(LogicItem(before, END, id="lit_end"))
    orientations = [NamedOrientation("default", Orientation(), "ori_bench")]
    point = ActionPoint("ap", Position(), id="acp_bench", orientations=orientations, actions=actions)
    return Project(
        f"bench {size}", _SCENE.id, id=f"pro_{size}", action_points=[point], functions=functions, logic=logic
    )


async def build(report: Report) -> None:
    """Report the times of builds and of reading the script back."""
    with tempfile.TemporaryDirectory() as directory:
        settings = ServerSettings(data_dir=Path(directory))
        storage = await Storage.open(settings)
        try:
            await storage.put_object_type(ObjectTypeSource("Bench", _SOURCE))
            types = ObjectTypes(KnownTypes(), storage, await AssetStore.open(settings.assets_dir))
            await types.load()
            await storage.put_scene(_SCENE)
            service = BuildService(settings, storage, types)
            times: dict[int, list[float]] = {size: [] for size in SIZES}
            for size in SIZES:
                await storage.put_project(project(size))
            await service.build(f"pro_{SIZES[0]}", "warm")
            reading = [_read_back(await service.collect("pro_1000"), types) for _ in range(ROUNDS)]
            merging = [_merge(await service.collect("pro_1000"), types) for _ in range(ROUNDS)]
            for _ in range(ROUNDS):
                for size in SIZES:
                    begin = time.perf_counter()
                    await service.build(f"pro_{size}", "bench")
                    times[size].append((time.perf_counter() - begin) * 1e3)
        finally:
            await storage.close()
    medians = {size: median(samples) for size, samples in times.items()}
    note = ", ".join(f"{size} actions {value:.0f} ms" for size, value in medians.items())
    report.add(Metric("build_1000_ms", medians[1000], ROUNDS, note))
    report.add(Metric("build_10000_ms", medians[10_000], ROUNDS))
    report.add(Metric("read_script_1000_ms", median(reading), ROUNDS))
    report.add(Metric("merge_script_1000_ms", median(merging), ROUNDS))


def _read_back(source_of: BuildInput, types: ObjectTypes) -> float:
    """Return the time to convert a generated script back to its project, ms."""
    facts = CombinedTypes(types.files(), {}).facts(source_of.scene)
    source = from_logic(source_of.scene, source_of.project, facts)
    begin = time.perf_counter()
    back = from_script(source, source_of.scene, source_of.project, facts)
    elapsed = (time.perf_counter() - begin) * 1e3
    if back != source_of.project:
        raise RuntimeError("The script was not converted back to the same project.")
    return elapsed


def _merge(source_of: BuildInput, types: ObjectTypes) -> float:
    """Return the time to generate a script with comments after a parameter was changed, ms."""
    facts = CombinedTypes(types.files(), {}).facts(source_of.scene)
    plain = from_logic(source_of.scene, source_of.project, facts)
    source = re.sub(r"(?m)^( +)(bench\.)", r"\1# Comment\n\1\2", plain)
    [point] = source_of.project.action_points
    changed = next(one for one in point.actions if len(one.parameters) > 1)
    pose, speed = changed.parameters
    actions = [
        replace(one, parameters=[pose, replace(speed, value="0.75")]) if one is changed else one
        for one in point.actions
    ]
    project = replace(source_of.project, action_points=[replace(point, actions=actions)], script=source)
    begin = time.perf_counter()
    merged = from_logic(source_of.scene, project, facts)
    elapsed = (time.perf_counter() - begin) * 1e3
    if merged.count("# Comment") != source.count("# Comment") or "0.75" not in merged:
        raise RuntimeError("The comments were not kept.")
    return elapsed


if __name__ == "__main__":
    metrics = Report()
    asyncio.run(build(metrics))
    metrics.table()
