"""Messages for users: the English text, and the template and values from which clients translate it."""

from string import Formatter
from typing import Final

from msgspec import Struct

_FORMATTER: Final = Formatter()


class Message(Struct, frozen=True):
    """A text for users, with what is needed to translate it. `str(message)` is the text.

    Attributes:
        text: The English text.
        key: The template of the text with plain `{name}` fields. It is the key of translations.
        values: The formatted texts of the fields, by name. Without values, `key` is the text itself.
    """

    text: str
    key: str
    values: dict[str, str] = {}

    def __str__(self) -> str:
        return self.text

    @classmethod
    def of(cls, template: str, /, **values: object) -> "Message":
        """Return the message of a template, such as "{robot} did not answer within {limit:.1f} s.".

        Args:
            template: A `str.format` template with named fields. Without values it is the text; braces have no meaning.
            values: Values of the fields, by name.

        Raises:
            KeyError: A field of the template has no value.
        """
        if not values:
            return cls(template, template)
        text, key, formatted = [], [], {}
        for literal, name, spec, conversion in _FORMATTER.parse(template):
            text.append(literal)
            key.append(literal.replace("{", "{{").replace("}", "}}"))
            if name is not None:
                value = _FORMATTER.convert_field(values[name], conversion)
                formatted[name] = format(value, spec or "")
                text.append(formatted[name])
                key.append(f"{{{name}}}")
        return cls("".join(text), "".join(key), formatted)
