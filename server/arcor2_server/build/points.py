"""Generates action_points.py of a package: typed access to the action points of a project by name.

The generated classes call `position(action_point_id)`, `pose(orientation_id)` and `joints(joints_id)` of `Resources`
(arcor2_hw.runtime.resources). Each call returns a new copy in world coordinates.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from arcor2_hw.data.project import ActionPoint, Project
from arcor2_server.build.naming import Names, class_name
from arcor2_server.build.style import quoted

_IMPORTED: Final = ("Pose", "Position", "ProjectRobotJoints", "Resources", "ActionPoints")
_OWN_FIELD: Final = "_res"


@dataclass(frozen=True, slots=True)
class PointNames:
    """The names of positions, poses and joints in a script, by id, as parts of a dotted name after `aps`."""

    positions: dict[str, tuple[str, ...]] = field(default_factory=dict)
    poses: dict[str, tuple[str, ...]] = field(default_factory=dict)
    joints: dict[str, tuple[str, ...]] = field(default_factory=dict)


def names_of(project: Project) -> PointNames:
    """Return the names of all positions, poses and joints of a project."""
    result = PointNames()
    points = Names([_OWN_FIELD])
    for point in project.action_points:
        own = points.claim(point.name)
        result.positions[point.id] = (own, "position")
        poses, joints = Names([_OWN_FIELD]), Names([_OWN_FIELD])
        for orientation in point.orientations:
            result.poses[orientation.id] = (own, "poses", poses.claim(orientation.name))
        for one in point.robot_joints:
            result.joints[one.id] = (own, "joints", joints.claim(one.name))
    return result


def _class(name: str, title: str, fields: Sequence[str], properties: Sequence[tuple[str, str, str]]) -> str:
    lines = [
        f"class {name}:",
        f'    """{title}"""',
        "",
        "    def __init__(self, res: Resources) -> None:",
        *([f"        self.{_OWN_FIELD} = res"] if properties or not fields else []),
        *(f"        {line}" for line in fields),
    ]
    for attribute, kind, call in properties:
        lines += [
            "",
            "    @property",
            f"    def {attribute}(self) -> {kind}:",
            f"        return self.{_OWN_FIELD}.{call}",
        ]
    return "\n".join(lines)


def _point(point: ActionPoint, names: PointNames, classes: Names) -> tuple[str, list[str]]:
    """Return the name of an action point's class, and all required classes; its own class is the last one."""
    own = classes.claim(class_name(point.name))
    attribute = names.positions[point.id][0]
    parts: list[str] = []
    fields: list[str] = []
    if point.orientations:
        name = classes.claim(f"{own}Poses")
        poses = [(names.poses[o.id][-1], "Pose", f"pose({quoted(o.id)})") for o in point.orientations]
        parts.append(_class(name, f"Poses of {attribute}.", (), poses))
        fields.append(f"self.poses = {name}(res)")
    if point.robot_joints:
        name = classes.claim(f"{own}Joints")
        joints = [(names.joints[j.id][-1], "ProjectRobotJoints", f"joints({quoted(j.id)})") for j in point.robot_joints]
        parts.append(_class(name, f"Joints of {attribute}.", (), joints))
        fields.append(f"self.joints = {name}(res)")
    position = ("position", "Position", f"position({quoted(point.id)})")
    parts.append(_class(own, f"Action point {attribute}.", fields, [position]))
    return own, parts


def source(project: Project) -> str:
    """Return the source code of action_points.py."""
    names = names_of(project)
    classes = Names(_IMPORTED)
    parts: list[str] = []
    fields: list[str] = []
    for point in project.action_points:
        own, needed = _point(point, names, classes)
        parts += needed
        fields.append(f"self.{names.positions[point.id][0]} = {own}(res)")
    parts.append(_class("ActionPoints", "The action points of the project by name.", fields, ()))
    header = [
        '"""Action points in world coordinates, generated from the project. Each access is a new copy."""',
        "",
    ]
    if project.action_points:
        poses = "Pose, " if any(point.orientations for point in project.action_points) else ""
        header.append(f"from arcor2_hw.data.geometry import {poses}Position")
    if any(point.robot_joints for point in project.action_points):
        header.append("from arcor2_hw.data.project import ProjectRobotJoints")
    header.append("from arcor2_hw.runtime.resources import Resources")
    return "\n".join(header) + "\n\n\n" + "\n\n\n".join(parts) + "\n"
