"""For any source, the analysis returns a result that can be sent and that names the place of each problem."""

import string
import tokenize
from io import StringIO

import msgspec
from hypothesis import HealthCheck, given, settings, strategies as st

from arcor2_hw.analysis import Library, SourceFile

HEAD = """
import abc, dataclasses, enum, math, typing
from typing import ClassVar, Optional, Union
from arcor2_hw.actions import IntEnum, StrEnum, action
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import ActionMetadata
from arcor2_hw.data.robot import RobotType
from arcor2_hw.objects import Generic, Machine, Robot, Settings
from .other import *
from . import other
from .other import X as Y
"""
COMPLETE_SOURCE = (
    HEAD
    + '''
LIMIT = 2.0
class Mode(StrEnum):
    FAST = "fast"
    SLOW = enum.auto()
@dataclasses.dataclass
class S(Settings):
    """Settings.

    :param url: where
    """
    url: str = "x"
    mode: Mode = Mode.SLOW
    rest: int = dataclasses.field(default=1, kw_only=True)
class T(Machine, Robot):
    """A type."""
    _ABSTRACT = False
    robot_type = RobotType.SCARA
    CANCEL_MAPPING = {"move": "stop"}
    DYNAMIC_PARAMS = {"item": ("items", {"mode"})}
    def __init__(self, obj_id: str, name: str, pose: Pose, settings: "S | None" = None) -> None:
        super().__init__(obj_id, name, pose, settings)
    @property
    @abc.abstractmethod
    def state(self) -> int: ...
    @action(composite=True, hidden=not True)
    def move(self, target: Pose, mode: Mode = Mode.FAST, speed: float = LIMIT / 2, *,
             an: str | None = None) -> tuple[int, Mode]:
        """Move.

        :param speed: how fast
        """
        assert 0.0 <= speed <= 1.0
    def older(self, item: str, *, an: Union[None, str] = None) -> None:
        raise Arcor2NotImplemented("older")
    older.__action__ = ActionMetadata(hidden=False)
    def stop(self) -> None:
        raise ValueError
'''
)
OTHER = "from .t import T, Mode\nclass X(T):\n    pass\nclass Other(X):\n    _ABSTRACT = Mode.FAST\n"

NAMES = [
    "T",
    "X",
    "Y",
    "Mode",
    "S",
    "Generic",
    "Robot",
    "Settings",
    "Pose",
    "int",
    "str",
    "None",
    "other",
    "LIMIT",
    "an",
]
ATOMS = [
    *NAMES,
    "1",
    "1.5",
    '"a"',
    "'T'",
    "'int |'",
    "True",
    "...",
    "b'x'",
    "1j",
    "lambda: 0",
    "f'{T}'",
    "other.X",
    "T.T",
    "[]",
]


def shapes(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return st.one_of(
        st.tuples(inner, inner).map(lambda p: f"{p[0]} | {p[1]}"),
        st.tuples(inner, inner).map(lambda p: f"{p[0]}[{p[1]}]"),
        st.tuples(inner, inner).map(lambda p: f"({p[0]}, {p[1]})"),
        st.tuples(inner, inner).map(lambda p: f"{{{p[0]}: {p[1]}}}"),
        st.tuples(inner, inner).map(lambda p: f"({p[0]}) * ({p[1]})"),
        st.tuples(inner, inner).map(lambda p: f"{{{p[0]}, *{p[1]}}}"),
        st.tuples(inner, st.sampled_from(NAMES)).map(lambda p: f"({p[0]}).{p[1]}"),
        inner.map(lambda p: f"Optional[{p}]"),
        inner.map(lambda p: f"Union[{p}, None]"),
        inner.map(lambda p: f"tuple[{p}]"),
        inner.map(lambda p: f"-({p})"),
        inner.map(lambda p: f"({p})()"),
        inner.map(lambda p: f"set({p})"),
        inner.map(lambda p: f"dataclasses.field(default={p}, init={p})"),
        inner.map(lambda p: f"({p}).__name__"),
        inner.map(lambda p: f"({p}).value"),
        inner.map(repr),
    )


EXPRESSION = st.recursive(st.sampled_from(ATOMS), shapes, max_leaves=4)


@st.composite
def modules(draw: st.DrawFn) -> str:
    """Create a module with valid statements and arbitrary expressions."""

    def some(count: int = 2) -> list[str]:
        return draw(st.lists(EXPRESSION, max_size=count))

    one = EXPRESSION
    lines = [HEAD]
    for name in ("Mode", "S", "T"):
        if draw(st.booleans()):
            lines.append(f"@{draw(one)}")
        bases = draw(st.sampled_from([["StrEnum"], ["IntEnum"], ["Settings"], ["Generic"], ["Robot"], None])) or some()
        lines.append(f"class {name}({', '.join(bases)}):")
        attributes = ("_ABSTRACT", "robot_type", "CANCEL_MAPPING", "DYNAMIC_PARAMS", "A")
        lines.extend(f"    {each}: {draw(one)} = {draw(one)}" for each in attributes if draw(st.booleans()))
        lines.append(f"    def __init__(self, settings: {draw(one)} = {draw(one)}) -> {draw(one)}: ...")
        lines.append(f"    @{draw(st.one_of(st.just('action'), one))}")
        lines.append(
            f"    def act(self, a: {draw(one)} = {draw(one)}, *, b: {draw(one)} = {draw(one)},"
            f" an: {draw(st.one_of(st.just('str | None'), one))} = None) -> {draw(one)}:"
        )
        lines.append(f"        assert {draw(one)} <= a <= {draw(one)}\n        raise {draw(one)}")
        lines.append(f"    act.__action__ = {draw(st.one_of(st.just('ActionMetadata()'), one))}")
        lines.append(f"    def stop(self) -> {draw(one)}: raise {draw(one)}")
    lines.append(f"{draw(st.sampled_from(NAMES))} = {draw(one)}\nT.A = {draw(one)}")
    return "\n".join(lines)


def assert_valid_result(source: str | bytes, other: str = OTHER) -> None:
    lib = Library([SourceFile("T", "t", source), SourceFile("Other", "other", other)])
    for name in ("T", "Other"):
        found = lib.analyse(name)
        assert found.meta.disabled is (found.problem is not None)
        if found.problem is not None:
            assert found.problem.line >= 1
            assert found.problem.path
            assert found.problem.what.text
        for action in found.actions:
            assert action.disabled is isinstance(action.problem, str)
        msgspec.json.encode((found.meta, found.actions, found.robot, found.problem))


EXAMPLES = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])


@EXAMPLES
@given(st.one_of(st.text(max_size=200), st.binary(max_size=200), st.text(string.printable, max_size=300)))
def test_any_source_has_a_valid_result(source: str | bytes) -> None:
    assert_valid_result(source)


@EXAMPLES
@given(modules())
def test_a_module_with_arbitrary_expressions_has_a_valid_result(source: str) -> None:
    assert_valid_result(source)


TOKENS = [token.string for token in tokenize.generate_tokens(StringIO(COMPLETE_SOURCE).readline)]
OFFSETS = [
    sum(len(line) for line in COMPLETE_SOURCE.splitlines(keepends=True)[: token.start[0] - 1]) + token.start[1]
    for token in tokenize.generate_tokens(StringIO(COMPLETE_SOURCE).readline)
]


@EXAMPLES
@given(
    st.lists(st.tuples(st.integers(0, len(TOKENS) - 1), st.sampled_from([*sorted(set(TOKENS)), "\x00"])), max_size=3)
)
def test_a_source_with_replaced_tokens_has_a_valid_result(changes: list[tuple[int, str]]) -> None:
    source = COMPLETE_SOURCE
    for index, replacement in sorted(changes, reverse=True):
        start = OFFSETS[index]
        source = source[:start] + replacement + source[start + len(TOKENS[index]) :]
    assert_valid_result(source)


def test_the_original_source_is_valid() -> None:
    lib = Library([SourceFile("T", "t", COMPLETE_SOURCE),
                   SourceFile("Other", "other", OTHER)])  # fmt: skip
    found = lib.analyse("T")
    assert found.problem is None, found.problem
    assert [(a.name, a.disabled) for a in found.actions] == [("move", False), ("older", False), ("update_pose", False)]
    assert [s.name for s in found.meta.settings] == ["url", "mode", "rest"]
    assert lib.analyse("Other").problem is None
    assert lib.analyse("Other").bases[0] == "T"
