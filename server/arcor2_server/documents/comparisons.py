"""Conditions that compare several values: which comparisons are valid, and whether a list of conditions is complete."""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import msgspec

from arcor2_hw.data.base import Unset
from arcor2_hw.data.project import LogicComparison, LogicItem, LogicWhen, Match, Operator, parse_link
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import Message

Value = bool | int | float | str

_EQUALITY: Final = (Operator.EQUAL, Operator.DIFFERENT)
_ORDER: Final = (Operator.LESS, Operator.LESS_EQUAL, Operator.GREATER, Operator.GREATER_EQUAL)
RANGES: Final[Mapping[Operator, tuple[Operator, Operator]]] = {
    Operator.CLOSED: (Operator.LESS_EQUAL, Operator.LESS_EQUAL),
    Operator.RIGHT_OPEN: (Operator.LESS_EQUAL, Operator.LESS),
    Operator.LEFT_OPEN: (Operator.LESS, Operator.LESS_EQUAL),
    Operator.OPEN: (Operator.LESS, Operator.LESS),
}
"""The operators before and after the compared value in each kind of range, as in `3 <= n < 7`."""
OPERATORS: Final[Mapping[str, tuple[Operator, ...]]] = {
    "boolean": (Operator.EQUAL,),
    "integer": (*_EQUALITY, *_ORDER, *RANGES),
    "double": (*_ORDER, *RANGES),
    "integer_enum": _EQUALITY,
    "string_enum": _EQUALITY,
    "string": _EQUALITY,
}
"""The types of values that conditions can compare, with their operators. Doubles are rarely equal to a number."""
_VALUES: Final[Mapping[str, tuple[type, ...]]] = {
    "boolean": (bool,),
    "integer": (int,),
    "double": (int, float),
    "integer_enum": (int,),
    "string_enum": (str,),
    "string": (str,),
}
MAX_CASES: Final = 2000
"""Maximum number of combinations of values for which conditions are tested."""


class Reference(NamedTuple):
    """A compared value: result number `output` of action number `action`, or the project parameter `parameter`."""

    action: int
    output: int
    parameter: str = ""


class Comparison(NamedTuple):
    """A comparison with a constant, or with another value `other`. In a range, `value` is the lower limit."""

    what: Reference
    operator: Operator
    value: Value
    upper: int | float | None = None
    other: Reference | None = None

    def compared(self) -> tuple[Reference, ...]:
        """Return the compared values: `what`, and `other` if there is one."""
        return (self.what,) if self.other is None else (self.what, self.other)


class Comparisons(NamedTuple):
    """A condition of at least one comparison. It is true if all comparisons are true, or if any is."""

    comparisons: tuple[Comparison, ...]
    match: Match = Match.ALL


def is_result(link: str) -> bool:
    """Return whether a compared value is the result of an action, not a project parameter."""
    return "/" in link


def decoded(comparison: LogicComparison) -> tuple[Value, int | float | None]:
    """Return the value and the upper limit of a comparison; an empty text for one with another value.

    Raises:
        InvalidData: one of them is not JSON of a boolean, number or string, a required limit is missing, or
            a limit is combined with another value.
    """
    if not isinstance(comparison.other, Unset):
        if comparison.value or not isinstance(comparison.upper, Unset) or comparison.operator in RANGES:
            raise InvalidData("A comparison with another value has no constants.")
        return "", None
    try:
        value = msgspec.json.decode(comparison.value, type=bool | int | float | str)
        upper = None if isinstance(comparison.upper, Unset) else msgspec.json.decode(comparison.upper, type=int | float)
    except msgspec.DecodeError:
        raise InvalidData("A comparison has an invalid value: {value}.", value=comparison.value[:40]) from None
    if (upper is None) == (comparison.operator in RANGES):
        raise InvalidData("A range has two limits, any other comparison has one value.")
    return value, upper


def comparison_problem(name: str, kind: str, operator: Operator, value: Value, upper: float | None) -> Message | None:
    """Return the problem of a comparison of the value `name` of the type `kind`, None if it is valid."""
    if kind not in OPERATORS:
        return Message.of("{name} is {type}, which a condition cannot use", name=name, type=kind or "nothing")
    if kind == "double" and operator in _EQUALITY:
        return Message.of("{name} is a measured number, which is rarely equal to another one: use a range", name=name)
    if operator not in OPERATORS[kind]:
        return Message.of(
            "{name} is {type}, which cannot be compared by {operator}", name=name, type=kind, operator=operator
        )
    for one in (value, upper):
        if one is not None and (type(one) not in _VALUES[kind] or one in (math.inf, -math.inf)):
            return Message.of("{name} is {type} and cannot be compared with {value!r}", name=name, type=kind, value=one)
    if upper is not None and isinstance(value, int | float):
        above, below = RANGES[operator]
        if kind == "integer":
            empty = value + (above is Operator.LESS) > upper - (below is Operator.LESS)
        else:
            empty = value > upper or (value == upper and operator is not Operator.CLOSED)
        if empty:
            return Message.of(
                "the range of {name} from {lower} to {upper} is empty", name=name, lower=value, upper=upper
            )
    return None


def pair_problem(name: str, kind: str, operator: Operator, other_name: str, other_kind: str) -> Message | None:
    """Return the problem of a comparison of two values with their names and types, None if it is valid."""
    for one, type_ in ((name, kind), (other_name, other_kind)):
        if type_ not in OPERATORS:
            return Message.of("{name} is {type}, which a condition cannot use", name=one, type=type_ or "nothing")
    if kind != other_kind and not {kind, other_kind} <= {"integer", "double"}:
        return Message.of(
            "{name} is {type} and cannot be compared with {other}, which is {other_type}",
            name=name,
            type=kind,
            other=other_name,
            other_type=other_kind,
        )
    if "double" in (kind, other_kind) and operator in _EQUALITY:
        measured = name if kind == "double" else other_name
        return Message.of("{name} is a measured number, which is rarely equal to another one", name=measured)
    if operator not in (*OPERATORS[kind], *_EQUALITY) or operator in RANGES:
        return Message.of(
            "{name} is {type}, which cannot be compared by {operator}", name=name, type=kind, operator=operator
        )
    return None


def inverse(condition: Comparisons) -> Comparisons | None:
    """Return the opposite of a single comparison for equality, None for other conditions."""
    [one, *more] = condition.comparisons
    if more or one.operator not in _EQUALITY:
        return None
    if isinstance(one.value, bool):
        return Comparisons((one._replace(value=not one.value),))
    opposite = Operator.DIFFERENT if one.operator is Operator.EQUAL else Operator.EQUAL
    return Comparisons((one._replace(operator=opposite),))


def check_when(when: LogicWhen, kind_of: Callable[[str], tuple[str, str]]) -> None:
    """Check the comparisons of a logic item.

    Args:
        when: the comparisons.
        kind_of: returns the name and the type of a compared value.

    Raises:
        InvalidData: a comparison is invalid or is given twice.
    """
    seen: set[object] = set()
    for one in when.comparisons:
        value, upper = decoded(one)
        if isinstance(one.other, Unset):
            problem = comparison_problem(*kind_of(one.what), one.operator, value, upper)
        elif one.other == one.what:
            raise InvalidData("A comparison compares a value with itself.")
        else:
            problem = pair_problem(*kind_of(one.what), one.operator, *kind_of(one.other))
        if problem is not None:
            raise InvalidData("{problem}.", problem=problem)
        key = (one.what, one.operator, type(value), value, upper, one.other)
        if key in seen:
            raise InvalidData("A comparison is given twice.")
        seen.add(key)


def condition_key(item: LogicItem) -> object:
    """Return the condition of an item in comparable form, None without one.

    A condition and a single comparison by `==` have the same key.
    """
    parts: list[object] = []
    if item.when is not None and not isinstance(item.when, Unset) and item.when.comparisons:
        for one in item.when.comparisons:
            try:
                value, upper = decoded(one)
            except InvalidData:
                parts.append((one.what, one.operator, one.value, one.upper, one.other))
                continue
            other = None if isinstance(one.other, Unset) else one.other
            parts.append((one.what, one.operator, isinstance(value, bool), value, upper, other))
        return tuple(parts), item.when.match if len(parts) > 1 else Match.ALL
    if isinstance(item.condition, Unset):
        return None
    try:
        value = msgspec.json.decode(item.condition.value, type=bool | int | float | str)
    except msgspec.DecodeError:
        return item.condition.what, item.condition.value
    return ((item.condition.what, Operator.EQUAL, isinstance(value, bool), value, None, None),), Match.ALL


def text_of(when: LogicWhen, name: Callable[[str], str]) -> str:
    """Return comparisons as text, such as `3 <= n < 7 and passed`; `name` returns the name of a compared value."""

    def text(comparison: LogicComparison) -> str:
        called = name(comparison.what)
        if comparison.operator in RANGES:
            above, below = RANGES[comparison.operator]
            return f"{comparison.value} {above} {called} {below} {comparison.upper}"
        other = comparison.value if isinstance(comparison.other, Unset) else name(comparison.other)
        return f"{called} {comparison.operator} {other}"

    return (" and " if when.match is Match.ALL else " or ").join(map(text, when.comparisons))


def what_of(text: str) -> tuple[str, int] | str:
    """Return action id and output index of the compared result, or the id of the compared parameter.

    Raises:
        ValueError: the text is malformed.
    """
    if "/" not in text:
        return text
    action_id, flow, output = parse_link(text)
    if flow != "default":
        raise ValueError(f"{text!r} is not <action id>/default/<output index>")
    return action_id, output


# ------------------------------------------------------------------------------------------------ completeness
def _holds(comparison: Comparison, values: Mapping[Reference, Value]) -> bool:
    value = values[comparison.what]
    limit = comparison.value if comparison.other is None else values[comparison.other]
    match comparison.operator:
        case Operator.EQUAL:
            return value == limit
        case Operator.DIFFERENT:
            return value != limit
    assert isinstance(value, int | float), "only numbers are ordered"
    assert isinstance(limit, int | float), "only numbers are ordered"
    match comparison.operator:
        case Operator.LESS:
            return value < limit
        case Operator.LESS_EQUAL:
            return value <= limit
        case Operator.GREATER:
            return value > limit
        case Operator.GREATER_EQUAL:
            return value >= limit
    assert comparison.upper is not None, "a range has an upper limit"
    above, below = RANGES[comparison.operator]
    return (value > limit or (above is Operator.LESS_EQUAL and value == limit)) and (
        value < comparison.upper or (below is Operator.LESS_EQUAL and value == comparison.upper)
    )


def holds(condition: Comparisons, values: Mapping[Reference, Value]) -> bool:
    """Return whether a condition is true for some values."""
    tested = (_holds(one, values) for one in condition.comparisons)
    return all(tested) if condition.match is Match.ALL else any(tested)


def _samples(kind: str, constants: Sequence[Value], kinds: Sequence[str]) -> list[Value]:
    """Return sample values of a type that represent all values with respect to the comparisons.

    Args:
        kind: the type.
        constants: the constants with which the values are compared.
        kinds: the types of the values that are compared with each other, including this one. Between two constants
            there are as many samples as values, so that these have any order.
    """
    if kind == "boolean":
        return [True, False]
    count = len(kinds)
    texts = [one for one in constants if isinstance(one, str)]
    if kind in ("string", "string_enum"):
        others = (text for number in itertools.count() if (text := "other" + "_" * number) not in texts)
        return [*dict.fromkeys(texts), *itertools.islice(others, count)]
    numbers = [one for one in constants if isinstance(one, int | float)] or [0]
    shifts = sorted(range(-count, count + 1), key=abs)
    near = dict.fromkeys(
        value + shift for one in numbers for value in {math.floor(one), math.ceil(one)} for shift in shifts
    )
    if kind != "double":
        return list(near)
    fixed = sorted({*numbers, *(near if "integer" in kinds else ())})
    between = [
        low + (high - low) * n / (count + 1) for low, high in itertools.pairwise(fixed) for n in range(1, count + 1)
    ]
    below = [fixed[0] - n * max(1.0, abs(fixed[0])) for n in range(1, count + 1)]
    above = [fixed[-1] + n * max(1.0, abs(fixed[-1])) for n in range(1, count + 1)]
    return [*fixed, *between, *below, *above]


class Cases(NamedTuple):
    """Coverage of all values by conditions that are tested in order.

    Args:
        unused: the numbers of the conditions that never apply.
        gap: values for which no condition is true; None if there are none.
        known: whether all values were tested. It is false if there are too many combinations.
    """

    unused: tuple[int, ...]
    gap: Mapping[Reference, Value] | None
    known: bool


def _groups(conditions: Sequence[Comparisons]) -> list[list[Reference]]:
    """Return the values that are compared with each other, directly or through others."""
    groups: dict[Reference, list[Reference]] = {}
    for one in (one for condition in conditions for one in condition.comparisons):
        joined: dict[Reference, None] = {}
        for what in one.compared():
            joined |= dict.fromkeys(groups.get(what, [what]))
        group = list(joined)
        groups |= dict.fromkeys(group, group)
    return [group for what, group in groups.items() if group[0] == what]


def _all_values(kinds: Mapping[Reference, str], conditions: Sequence[Comparisons]) -> Iterator[dict[Reference, Value]]:
    constants: dict[Reference, list[Value]] = {}
    for condition in conditions:
        for one in condition.comparisons:
            if one.other is None:
                limits = [limit for limit in (one.value, one.upper) if limit is not None]
                constants.setdefault(one.what, []).extend(limits)
    samples: dict[Reference, list[Value]] = {}
    for group in _groups(conditions):
        common = [value for what in group for value in constants.get(what, ())]
        samples |= {what: _samples(kinds[what], common, [kinds[one] for one in group]) for what in group}
    if math.prod(map(len, samples.values())) > MAX_CASES:
        return
    for values in itertools.product(*samples.values()):
        yield dict(zip(samples, values, strict=True))


def cases_of(conditions: Sequence[Comparisons], kinds: Mapping[Reference, str]) -> Cases:
    """Return the coverage of all values of the types `kinds` by valid conditions that are tested in order."""
    unused = set(range(len(conditions)))
    gap: dict[Reference, Value] | None = None
    known = False
    for values in _all_values(kinds, conditions):
        known = True
        taken = next((number for number, one in enumerate(conditions) if holds(one, values)), None)
        if taken is not None:
            unused.discard(taken)
        elif gap is None:
            gap = values
    return Cases(tuple(sorted(unused)) if known else (), gap, known)
