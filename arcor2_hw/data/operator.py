"""Operators of comparisons, in conditions of programs and of interlocks."""

import enum


class Operator(enum.StrEnum):
    """Operators of comparisons. A range is an interval: `[` and `]` include the limit, `(` and `)` do not."""

    EQUAL = "=="
    DIFFERENT = "!="
    LESS = "<"
    LESS_EQUAL = "<="
    GREATER = ">"
    GREATER_EQUAL = ">="
    CLOSED = "[]"
    RIGHT_OPEN = "[)"
    LEFT_OPEN = "(]"
    OPEN = "()"
