"""Logic: comparisons of numbers and texts, and operations on booleans. All return a boolean for conditions."""

from arcor2_hw.actions import action
from arcor2_hw.objects import Generic


class LogicActions(Generic):
    """Compares values and combines booleans."""

    category = "Program"
    icon = "logic"
    _ABSTRACT = False
    display_name = "Logic"

    # ------------------------------------------------------------------------------------ numbers
    @action
    def equals(self, value: float, other: float, tolerance: float = 1e-9, *, an: str | None = None) -> bool:
        """Return whether two numbers are equal.

        :param value: first number
        :param other: second number
        :param tolerance: maximum difference
        """
        return abs(value - other) <= tolerance

    @action
    def greater_than(self, value: float, other: float, *, an: str | None = None) -> bool:
        """Return whether a number is greater than another.

        :param value: first number
        :param other: second number
        """
        return value > other

    @action
    def less_than(self, value: float, other: float, *, an: str | None = None) -> bool:
        """Return whether a number is less than another.

        :param value: first number
        :param other: second number
        """
        return value < other

    @action
    def within(self, value: float, minimum: float, maximum: float, *, an: str | None = None) -> bool:
        """Return whether a number is in a range, including its ends.

        :param value: number
        :param minimum: lower end
        :param maximum: upper end
        """
        return minimum <= value <= maximum

    # ------------------------------------------------------------------------------------ integers
    @action
    def integer_equals(self, value: int, other: int, *, an: str | None = None) -> bool:
        """Return whether two integers are equal.

        :param value: first integer
        :param other: second integer
        """
        return value == other

    @action
    def integer_greater_than(self, value: int, other: int, *, an: str | None = None) -> bool:
        """Return whether an integer is greater than another.

        :param value: first integer
        :param other: second integer
        """
        return value > other

    @action
    def integer_less_than(self, value: int, other: int, *, an: str | None = None) -> bool:
        """Return whether an integer is less than another.

        :param value: first integer
        :param other: second integer
        """
        return value < other

    @action
    def integer_within(self, value: int, minimum: int, maximum: int, *, an: str | None = None) -> bool:
        """Return whether an integer is in a range, including its ends.

        :param value: integer
        :param minimum: lower end
        :param maximum: upper end
        """
        return minimum <= value <= maximum

    # ------------------------------------------------------------------------------------ text
    @action
    def string_equals(self, text: str, other: str, *, an: str | None = None) -> bool:
        """Return whether two texts are equal.

        :param text: first text
        :param other: second text
        """
        return text == other

    @action
    def string_contains(self, text: str, part: str, *, an: str | None = None) -> bool:
        """Return whether a text contains another.

        :param text: text to search in
        :param part: text to search for
        """
        return part in text

    # ------------------------------------------------------------------------------------ booleans
    @action
    def logical_and(self, first: bool, second: bool, *, an: str | None = None) -> bool:
        """Return whether both values are true.

        :param first: first value
        :param second: second value
        """
        return first and second

    @action
    def logical_or(self, first: bool, second: bool, *, an: str | None = None) -> bool:
        """Return whether at least one value is true.

        :param first: first value
        :param second: second value
        """
        return first or second

    @action
    def logical_xor(self, first: bool, second: bool, *, an: str | None = None) -> bool:
        """Return whether exactly one value is true.

        :param first: first value
        :param second: second value
        """
        return first is not second

    @action
    def logical_not(self, value: bool, *, an: str | None = None) -> bool:
        """Return the opposite of a value.

        :param value: value to negate
        """
        return not value

    # ------------------------------------------------------------------------------------ values for variables
    @action
    def integer(self, value: int, *, an: str | None = None) -> int:
        """Return an integer, to store it in a variable.

        :param value: the integer
        """
        return value

    @action
    def number(self, value: float, *, an: str | None = None) -> float:
        """Return a number, to store it in a variable.

        :param value: the number
        """
        return value

    @action
    def text(self, value: str, *, an: str | None = None) -> str:
        """Return a text, to store it in a variable.

        :param value: the text
        """
        return value

    @action
    def boolean(self, value: bool, *, an: str | None = None) -> bool:
        """Return a boolean, to store it in a variable.

        :param value: the boolean
        """
        return value

    @action
    def add_integers(self, value: int, by: int = 1, *, an: str | None = None) -> int:
        """Return the sum of two integers.

        :param value: first integer
        :param by: second integer
        """
        return value + by

    @action
    def add_numbers(self, value: float, by: float, *, an: str | None = None) -> float:
        """Return the sum of two numbers.

        :param value: first number
        :param by: second number
        """
        return value + by
