"""Parsing and validation of URDF: links, joints, shapes, and our extensions for settings and end effectors.

Everything in the format (wiki.ros.org/urdf/XML) that places or limits parts is read; inertia, colours, transmissions
and elements of simulators are ignored. Our extension is one element `arcor2_hw`, which other readers ignore:

    <arcor2_hw>
      <end_effector link="tcp" free="rz" position_tolerance="1e-3" orientation_tolerance="0.02"/>
      <setting name="link_1" joint="joint_2" component="x"/>          the joint's origin: x, y, z (m), rx, ry, rz (rad)
      <setting name="lower_1" joint="joint_1" component="lower"/>     its limit: lower, upper, velocity
      <setting name="link_1" link="link_1" component="x"/>            scales the boxes of a link from its origin
      <disable_collisions link1="base" link2="forearm"/>
    </arcor2_hw>
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Final, TypeVar
from xml.etree.ElementTree import Element

import numpy as np

from arcor2_hw.kinematics.description import (
    KINDS,
    ORIGIN,
    Description,
    EndEffector,
    Geometry,
    Joint,
    Link,
    MeshFile,
    Mimic,
    Primitive,
    Setting,
)
from arcor2_hw.kinematics.errors import JointLoop, ModelError, UnsafeDescription
from arcor2_hw.kinematics.shapes import Array
from arcor2_hw.kinematics.xml_parser import parse_xml
from arcor2_hw.messages import Message, translatable

MAX_PARTS: Final = 2000
"""Maximum number of links."""

_Part = TypeVar("_Part", Link, Joint)


def describe(content: bytes, name: str) -> Description:
    """Parse a URDF.

    Args:
        content: The file.
        name: Name of the file in messages.

    Raises:
        ModelError: The URDF is invalid; the message names the link or joint.
        JointLoop: The joints form a loop.
        UnsafeDescription: The file is rejected for safety.
    """
    root = parse_xml(content, name)
    if root.tag != "robot":
        raise ModelError("{name} describes a {tag}, not a robot.", name=name, tag=root.tag)
    robot = root.get("name") or name
    links = _unique(
        [_link(each, robot) for each in root.findall("link")],
        translatable("{robot}: link {name} is defined twice."),
        robot,
    )
    if not links:
        raise ModelError("{robot} has no links.", robot=robot)
    if len(links) > MAX_PARTS:
        raise UnsafeDescription(
            "{robot} has {count} links; the maximum is {max_parts}.", robot=robot, count=len(links), max_parts=MAX_PARTS
        )
    joints = _unique(
        [_joint(each, robot) for each in root.findall("joint")],
        translatable("{robot}: joint {name} is defined twice."),
        robot,
    )
    base, ordered = _tree(robot, links, joints.values())
    _check_mimics(robot, joints)
    ours = root.find("arcor2_hw")
    found = Description(robot, base, links, ordered, ())
    if ours is None:
        return replace(found, end_effectors=_leaves(found))
    effectors = tuple(_end_effector(each, found) for each in ours.findall("end_effector"))
    settings = tuple(_setting(each, found) for each in ours.findall("setting"))
    pairs = (
        frozenset({_text(e, "link1", robot), _text(e, "link2", robot)}) for e in ours.findall("disable_collisions")
    )
    return replace(found, end_effectors=effectors or _leaves(found), settings=settings, touching=frozenset(pairs))


def _unique(parts: Iterable[_Part], refusal: str, robot: str) -> dict[str, _Part]:
    found: dict[str, _Part] = {}
    for part in parts:
        if part.name in found:
            raise ModelError(refusal, robot=robot, name=part.name)
        found[part.name] = part
    return found


# ------------------------------------------------------------------------------------------------ parts
def _text(element: Element, attribute: str, place: str | Message) -> str:
    value = element.get(attribute)
    if not value:
        raise ModelError("{place}: {tag} has no {attribute}.", place=place, tag=element.tag, attribute=attribute)
    return value


def _numbers(element: Element, attribute: str, default: tuple[float, ...], place: str | Message) -> tuple[float, ...]:
    value = element.get(attribute)
    if value is None:
        return default
    try:
        found = tuple(map(float, value.split()))
    except ValueError:
        found = ()
    if len(found) != len(default) or not all(map(math.isfinite, found)):
        raise ModelError(
            "{place}: {attribute} of {tag} must be {count} numbers, not {value!r}.",
            place=place,
            attribute=attribute,
            tag=element.tag,
            count=len(default),
            value=value,
        )
    return found


def _number(element: Element, attribute: str, default: float, place: str | Message) -> float:
    return _numbers(element, attribute, (default,), place)[0]


def transform(xyz: tuple[float, ...], rpy: tuple[float, ...]) -> Array:
    """Return the matrix (4, 4) of a position and of rotations about the fixed axes x, then y, then z."""
    (cr, cp, cy), (sr, sp, sy) = map(math.cos, rpy), map(math.sin, rpy)
    out = np.eye(4)
    out[0, :3] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    out[1, :3] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    out[2, :3] = -sp, cp * sr, cp * cr
    out[:3, 3] = xyz
    return out


def _origin(element: Element, place: str | Message) -> Array:
    found = element.find("origin")
    if found is None:
        return np.eye(4)
    return transform(_numbers(found, "xyz", (0.0,) * 3, place), _numbers(found, "rpy", (0.0,) * 3, place))


def _link(element: Element, robot: str) -> Link:
    name = _text(element, "name", robot)
    where = Message.of("{robot}: link {name}", robot=robot, name=name)
    visual, collision = (
        tuple(_geometry(each, Message.of("{place}, {kind}", place=where, kind=kind)) for each in element.findall(kind))
        for kind in ("visual", "collision")
    )
    return Link(name, visual, collision)


def _geometry(element: Element, place: str | Message) -> Geometry:
    found = element.find("geometry")
    what = found[0] if found is not None and len(found) else None
    if what is None:
        raise ModelError("{place}: the geometry is missing.", place=place)
    origin = _origin(element, place)
    match what.tag:
        case "mesh":
            sx, sy, sz = _numbers(what, "scale", (1.0, 1.0, 1.0), place)
            return Geometry(MeshFile(_text(what, "filename", place), (sx, sy, sz)), origin)
        case "box":
            return Geometry(Primitive("box", _numbers(what, "size", (0.0, 0.0, 0.0), place)), origin)
        case "cylinder" | "capsule" as kind:
            sizes = _number(what, "radius", 0.0, place), _number(what, "length", 0.0, place)
            return Geometry(Primitive(kind, sizes), origin)
        case "sphere":
            return Geometry(Primitive("sphere", (_number(what, "radius", 0.0, place),)), origin)
    raise ModelError("{place}: geometry of kind {tag} is not supported.", place=place, tag=what.tag)


def _joint(element: Element, robot: str) -> Joint:
    name = _text(element, "name", robot)
    where = Message.of("{robot}: joint {name}", robot=robot, name=name)
    kind = _text(element, "type", where)
    if kind not in KINDS:
        raise ModelError(
            "{place} is of type {type}; supported are {kinds}.", place=where, type=kind, kinds=", ".join(KINDS)
        )
    parent, child = (element.find(each) for each in ("parent", "child"))
    if parent is None or child is None:
        raise ModelError("{place} needs a parent and a child.", place=where)
    x, y, z = (1.0, 0.0, 0.0)
    if (axis := element.find("axis")) is not None:
        x, y, z = _numbers(axis, "xyz", (1.0, 0.0, 0.0), where)
    length = math.hypot(x, y, z)
    if kind != "fixed" and length < 1e-6:
        raise ModelError("{place} has an axis of length zero.", place=where)
    lower, upper, velocity = _limits(element, kind, where)
    return Joint(
        name,
        kind,
        _text(parent, "link", where),
        _text(child, "link", where),
        _origin(element, where),
        (x / length, y / length, z / length) if length else (1.0, 0.0, 0.0),
        lower,
        upper,
        velocity,
        _mimic(element, where),
    )


def _limits(element: Element, kind: str, place: str | Message) -> tuple[float, float, float]:
    if kind == "fixed":
        return 0.0, 0.0, math.inf
    found = element.find("limit")
    velocity = math.inf if found is None else _number(found, "velocity", 0.0, place) or math.inf
    if kind == "continuous":
        return -math.inf, math.inf, velocity
    if found is None:
        if element.find("mimic") is not None:
            return -math.inf, math.inf, velocity
        raise ModelError("{place} has no limit.", place=place)
    lower, upper = _number(found, "lower", 0.0, place), _number(found, "upper", 0.0, place)
    if lower > upper:
        raise ModelError(
            "{place}: its lower limit {lower:g} is above the upper limit {upper:g}.",
            place=place,
            lower=lower,
            upper=upper,
        )
    return lower, upper, velocity


def _mimic(element: Element, place: str | Message) -> Mimic | None:
    found = element.find("mimic")
    if found is None:
        return None
    return Mimic(
        _text(found, "joint", place), _number(found, "multiplier", 1.0, place), _number(found, "offset", 0.0, place)
    )


# ------------------------------------------------------------------------------------------------ whole description
def _tree(robot: str, links: Mapping[str, Link], joints: Iterable[Joint]) -> tuple[str, tuple[Joint, ...]]:
    """Return the root link, and the joints ordered from there outwards.

    Raises:
        ModelError: A link is missing, or there are several roots.
        JointLoop: The joints form a loop.
    """
    to: dict[str, Joint] = {}
    behind: dict[str, list[Joint]] = {}
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise ModelError(
                    "{robot}: joint {name} refers to the link {link}, which does not exist.",
                    robot=robot,
                    name=joint.name,
                    link=link,
                )
        if joint.child in to:
            raise JointLoop(
                "{robot}: the joints {name} and {joint_name} have the same child link {child}.",
                robot=robot,
                name=to[joint.child].name,
                joint_name=joint.name,
                child=joint.child,
            )
        to[joint.child] = joint
        behind.setdefault(joint.parent, []).append(joint)
    roots = [name for name in links if name not in to]
    ordered: list[Joint] = []
    waiting = list(reversed(behind.get(roots[0], []))) if roots else []
    while waiting:
        ordered.append(joint := waiting.pop())
        waiting += reversed(behind.get(joint.child, []))
    if not roots or (len(roots) == 1 and len(ordered) < len(to)):
        reached = {joint.name for joint in ordered}
        around = [joint.name for joint in to.values() if joint.name not in reached]
        raise JointLoop("{robot}: the joints {around} form a loop.", robot=robot, around=", ".join(around))
    if len(roots) > 1:
        raise ModelError(
            "{robot}: multiple root links: {roots}. Exactly one is allowed.", robot=robot, roots=", ".join(roots)
        )
    return roots[0], tuple(ordered)


def _check_mimics(robot: str, joints: Mapping[str, Joint]) -> None:
    for joint in joints.values():
        mimic = joint.mimic
        if mimic is None:
            continue
        if (other := joints.get(mimic.joint)) is None or other.kind == "fixed":
            raise ModelError(
                "{robot}: joint {name} mimics {joint}, which is not a moving joint.",
                robot=robot,
                name=joint.name,
                joint=mimic.joint,
            )
        if other.mimic is not None:
            raise ModelError(
                "{robot}: joint {name} mimics {joint}, which itself mimics another joint.",
                robot=robot,
                name=joint.name,
                joint=mimic.joint,
            )


def _leaves(found: Description) -> tuple[EndEffector, ...]:
    """Return the links at the ends of moving chains."""
    inner = {joint.parent for joint in found.joints}
    moved = {found.root: False}
    for joint in found.joints:
        moved[joint.child] = moved[joint.parent] or joint.kind != "fixed"
    return tuple(EndEffector(link) for link, moves in moved.items() if moves and link not in inner)


def _end_effector(element: Element, found: Description) -> EndEffector:
    link = _text(element, "link", found.name)
    if link not in found.links:
        raise ModelError("{name}: the end effector {link} is not a link of the robot.", name=found.name, link=link)
    where = Message.of("{robot}: end effector {name}", robot=found.name, name=link)
    free = frozenset((element.get("free") or "").split())
    if free not in (frozenset(), frozenset({"rz"}), frozenset(ORIGIN[3:])):
        raise ModelError(
            "{place}: free must be empty, rz, or rx ry rz, not {element!r}.", place=where, element=element.get("free")
        )
    position = _number(element, "position_tolerance", EndEffector.position_tolerance, where)
    orientation = _number(element, "orientation_tolerance", EndEffector.orientation_tolerance, where)
    if not (0.0 < position < 0.1 and 0.0 < orientation < 0.5):
        raise ModelError("{place}: the tolerances must be above 0, and below 0.1 m and 0.5 rad.", place=where)
    return EndEffector(link, free, position, orientation)


def _setting(element: Element, found: Description) -> Setting:
    name, component = _text(element, "name", found.name), _text(element, "component", found.name)
    where = Message.of("{robot}: setting {name}", robot=found.name, name=name)
    if (joint := element.get("joint")) is not None:
        if joint not in {each.name for each in found.joints}:
            raise ModelError("{place}: joint {joint} does not exist.", place=where, joint=joint)
        if component not in (*ORIGIN, "lower", "upper", "velocity"):
            raise ModelError("{place}: a joint has no component {component}.", place=where, component=component)
        return Setting(name, "joint", joint, component)
    link = _text(element, "link", where)
    if link not in found.links or component not in ORIGIN[:3]:
        raise ModelError(
            "{place}: {component} of the link {link} cannot follow a setting.",
            place=where,
            component=component,
            link=link,
        )
    return Setting(name, "link", link, component)
