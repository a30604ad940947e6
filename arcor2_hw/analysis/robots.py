"""Features of a robot type (protocol, section 9.5)."""

import ast

from arcor2_hw.analysis.constants import constant
from arcor2_hw.analysis.hierarchy import Hierarchy
from arcor2_hw.analysis.hints import normal
from arcor2_hw.analysis.module import ClassInfo, FunctionNode, Value
from arcor2_hw.analysis.source import AnalysisStopped
from arcor2_hw.analysis.symbols import External, framework_name, is_framework
from arcor2_hw.data.base import UNSET
from arcor2_hw.data.robot import RobotFeatures, RobotMeta, RobotType

_METHODS = {
    "move_to_pose": "move_to_pose",
    "move_to_joints": "move_to_joints",
    "stop": "stop",
    "forward_kinematics": "forward_kinematics",
    "inverse_kinematics": "inverse_kinematics",
    "hand_teaching": "set_hand_teaching_mode",
}
_OURS = {
    "jog": ("jog",),
    "acknowledge_stop": ("acknowledge_protective_stop", "restart_safety"),
    "kinematic_calibration": ("kinematic_calibration",),
}
"""Features that are not in ARCOR2; omitted where a type does not have them."""


def robot_meta(name: str, info: ClassInfo, hierarchy: Hierarchy) -> RobotMeta:
    """Return the metadata of a robot type.

    `urdf_package_filename` is the name declared by the type; the file need not exist.

    Raises:
        AnalysisStopped: The type of robot cannot be determined.
    """
    urdf = hierarchy.attribute(info, "urdf_package_name")
    return RobotMeta(
        name,
        _robot_type(info, hierarchy),
        hierarchy.derives_from(info, "MultiArmRobot"),
        RobotFeatures(
            **{feature: _has(info, method, hierarchy) for feature, method in _METHODS.items()},
            **{feature: True for feature, methods in _OURS.items() if any(_has(info, m, hierarchy) for m in methods)},
        ),
        urdf if isinstance(urdf, str) and urdf else UNSET,
    )


def _robot_type(info: ClassInfo, hierarchy: Hierarchy) -> RobotType:
    found = hierarchy.find(info, "robot_type")
    if found is None:
        return RobotType.ARTICULATED
    owner, binding = found
    if isinstance(binding, Value) and binding.expression is not None:
        symbol = hierarchy.resolver.expression(binding.expression, owner.module, owner)
        if isinstance(symbol, External):
            kind, _, member = symbol.dotted.rpartition(".")
            if framework_name(External(kind)) == "RobotType" and member in RobotType.__members__:
                return RobotType[member]
        try:
            return RobotType(constant(binding.expression, owner.module, owner, hierarchy.resolver))
        except (AnalysisStopped, ValueError):
            pass
    raise owner.problem("robot_type must be a member of RobotType", getattr(binding, "expression", None))


def _has(info: ClassInfo, method: str, hierarchy: Hierarchy) -> bool:
    """Return whether a method is implemented, by the type or by one of our bases."""
    found = hierarchy.method(info, method)
    if found is None:
        return False
    owner, node = found
    if is_framework(owner):
        return not hierarchy.is_hook_only(node, owner) and not hierarchy.is_abstract(node, owner)
    for each in hierarchy.ancestors(info):
        declared = each.function(method)
        if declared is not None and is_framework(each):
            same = _signature(node, owner, hierarchy) == _signature(declared, each, hierarchy)
            return same and not hierarchy.is_hook_only(node, owner)
    return False


def _signature(node: FunctionNode, owner: ClassInfo, hierarchy: Hierarchy) -> tuple[object, ...]:
    arguments, module, resolver = node.args, owner.module, hierarchy.resolver

    def shown(argument: ast.arg) -> tuple[str, str]:
        return argument.arg, normal(argument.annotation, module, resolver)

    def default(expression: ast.expr | None) -> object:
        if expression is None:
            return None
        try:
            return repr(constant(expression, module, owner, resolver))
        except AnalysisStopped:
            return ast.dump(expression)

    return (
        isinstance(node, ast.AsyncFunctionDef),
        [shown(argument) for argument in [*arguments.posonlyargs, *arguments.args][1:]],
        [shown(argument) for argument in arguments.kwonlyargs],
        [default(expression) for expression in arguments.defaults],
        [default(expression) for expression in arguments.kw_defaults],
        arguments.vararg is not None or arguments.kwarg is not None,
        normal(node.returns, module, resolver),
    )
