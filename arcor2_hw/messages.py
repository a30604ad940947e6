"""Messages for users: the English text, with the template and values for translation by clients."""

from collections.abc import Sequence
from string import Formatter
from typing import Any, Final, TypeVar

from msgspec import Struct

_FORMATTER: Final = Formatter()


def key_of(template: str) -> str:
    """Return a template with plain fields: without conversions and format specifications."""
    return "".join(
        literal.replace("{", "{{").replace("}", "}}") + ("" if name is None else f"{{{name}}}")
        for literal, name, _, _ in _FORMATTER.parse(template)
    )


_T = TypeVar("_T")


def translatable(texts: _T) -> _T:
    """Return the texts. The call marks a text, or those of a table, for the extraction of translations."""
    return texts


class Message(Struct, frozen=True, omit_defaults=True):
    """A text for users with the data for its translation. `str(message)` is the text.

    Attributes:
        text: The English text.
        key: The template of the text with plain `{name}` fields. It is the key of translations.
        values: The values of the fields, by name: formatted texts, or messages that are part of this one. Without
            values, `key` is the text itself.
    """

    text: str
    key: str
    values: dict[str, "str | Message"] = {}

    def __str__(self) -> str:
        return self.text

    @classmethod
    def of(cls, template: str, /, **values: object) -> "Message":
        """Return the message of a template, such as "{robot} did not answer within {limit:.1f} s.".

        Args:
            template: A `str.format` template with named fields. Without values it is the text; braces have no meaning.
            values: Values of the fields, by name. An error or a message is translated as part of this one.

        Raises:
            KeyError: A field of the template has no value.
        """
        if not values:
            return cls(template, template)
        text = []
        used: dict[str, str | Message] = {}
        for literal, name, spec, conversion in _FORMATTER.parse(template):
            text.append(literal)
            if name is not None:
                part = values[name]
                formatted = format(_FORMATTER.convert_field(part, conversion), spec or "")
                inner = part if isinstance(part, Message) else getattr(part, "message", None)
                whole = isinstance(inner, Message) and inner.text == formatted
                used[name] = inner if whole else formatted  # type: ignore[assignment]
                text.append(formatted)
        return cls("".join(text), key_of(template), used)

    @classmethod
    def joined(cls, messages: Sequence["Message"]) -> "Message":
        """Return messages as one, separated by spaces. Clients translate each as a part of it."""
        return cls._parts(messages, " ")

    @classmethod
    def listed(cls, messages: Sequence["Message"]) -> "Message":
        """Return messages as one, separated by commas."""
        return cls._parts(messages, ", ")

    @classmethod
    def _parts(cls, messages: Sequence["Message"], separator: str) -> "Message":
        parts = {f"part{number}": message for number, message in enumerate(messages, 1)}
        return cls.of(separator.join(f"{{{name}}}" for name in parts), **parts) if len(parts) != 1 else messages[0]

    def translation(self) -> dict[str, Any]:
        """Return the fields `key` and `values` that are sent next to the text; empty if the text itself is the key."""
        return {"key": self.key, "values": self.values} if self.values else {}


class Phrase(str):
    """A text that is translated as a part of messages that have it as a value, such as the owner of control.

    Attributes:
        message: The text with its key and values.
    """

    __slots__ = ("message",)
    message: Message

    @classmethod
    def of(cls, template: str, /, **values: object) -> "Phrase":
        """Return the phrase of a template. Arguments as of `Message.of`."""
        message = Message.of(template, **values)
        found = cls(message.text)
        found.message = message
        return found


def device_at(device: str, address: "str | Message") -> Message:
    """Return the name of a device with its address, as a value of messages."""
    return Message.of("{device} at {address}", device=device, address=address)
