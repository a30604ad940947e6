"""Logic: comparisons of numbers and text, and what follows from truths. All give a boolean to branch on."""

from arcor2_hw.actions import action
from arcor2_hw.objects import Generic


class LogicActions(Generic):
    """Compares values and combines truths."""

    category = "Program"
    icon = "logic"
    _ABSTRACT = False

    # ------------------------------------------------------------------------------------ numbers with a fraction
    @action
    def equals(self, value: float, other: float, tolerance: float = 1e-9, *, an: str | None = None) -> bool:
        """Tell whether two numbers are equal.

        :param value: one number
        :param other: the other number
        :param tolerance: how far apart they may be
        """
        return abs(value - other) <= tolerance

    @action
    def greater_than(self, value: float, other: float, *, an: str | None = None) -> bool:
        """Tell whether a number is greater than another.

        :param value: the number
        :param other: what it is compared with
        """
        return value > other

    @action
    def less_than(self, value: float, other: float, *, an: str | None = None) -> bool:
        """Tell whether a number is less than another.

        :param value: the number
        :param other: what it is compared with
        """
        return value < other

    @action
    def within(self, value: float, minimum: float, maximum: float, *, an: str | None = None) -> bool:
        """Tell whether a number lies in a range, its ends included.

        :param value: the number
        :param minimum: the low end
        :param maximum: the high end
        """
        return minimum <= value <= maximum

    # ------------------------------------------------------------------------------------ whole numbers
    @action
    def integer_equals(self, value: int, other: int, *, an: str | None = None) -> bool:
        """Tell whether two whole numbers are equal.

        :param value: one number
        :param other: the other number
        """
        return value == other

    @action
    def integer_greater_than(self, value: int, other: int, *, an: str | None = None) -> bool:
        """Tell whether a whole number is greater than another.

        :param value: the number
        :param other: what it is compared with
        """
        return value > other

    @action
    def integer_less_than(self, value: int, other: int, *, an: str | None = None) -> bool:
        """Tell whether a whole number is less than another.

        :param value: the number
        :param other: what it is compared with
        """
        return value < other

    @action
    def integer_within(self, value: int, minimum: int, maximum: int, *, an: str | None = None) -> bool:
        """Tell whether a whole number lies in a range, its ends included.

        :param value: the number
        :param minimum: the low end
        :param maximum: the high end
        """
        return minimum <= value <= maximum

    # ------------------------------------------------------------------------------------ text
    @action
    def string_equals(self, text: str, other: str, *, an: str | None = None) -> bool:
        """Tell whether two texts are the same, letter by letter.

        :param text: one text
        :param other: the other text
        """
        return text == other

    @action
    def string_contains(self, text: str, part: str, *, an: str | None = None) -> bool:
        """Tell whether a text contains another.

        :param text: where it is looked for
        :param part: what is looked for
        """
        return part in text

    # ------------------------------------------------------------------------------------ truths
    @action
    def logical_and(self, first: bool, second: bool, *, an: str | None = None) -> bool:
        """Tell whether both are true.

        :param first: one truth
        :param second: the other
        """
        return first and second

    @action
    def logical_or(self, first: bool, second: bool, *, an: str | None = None) -> bool:
        """Tell whether at least one is true.

        :param first: one truth
        :param second: the other
        """
        return first or second

    @action
    def logical_xor(self, first: bool, second: bool, *, an: str | None = None) -> bool:
        """Tell whether exactly one is true.

        :param first: one truth
        :param second: the other
        """
        return first is not second

    @action
    def logical_not(self, value: bool, *, an: str | None = None) -> bool:
        """Tell whether it is false.

        :param value: the truth to turn round
        """
        return not value
