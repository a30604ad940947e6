"""XML parsing of untrusted files. Imports no numerics."""

from typing import Final
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from arcor2_hw.kinematics.errors import ModelError, UnsafeDescription

MAX_DEPTH: Final = 64


def parse_xml(content: bytes, name: str) -> Element:
    """Parse a document and return its root.

    Document types are rejected, so that entities cannot fetch or expand anything.

    Args:
        content: The document.
        name: Name of the file in messages.

    Raises:
        ModelError: It is not XML, or a xacro file.
        UnsafeDescription: It has a document type, or is nested too deeply.
    """
    parser = expat.ParserCreate()
    builder = TreeBuilder()
    depth = 0

    def refuse(*_: object) -> None:
        raise UnsafeDescription("{name} has a document type or an entity, which is not allowed. Remove it.", name=name)

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise UnsafeDescription(
                "{name} is nested deeper than {max_depth} elements.", name=name, max_depth=MAX_DEPTH
            )
        if tag.startswith("xacro:"):
            raise ModelError("{name} is a xacro file. Convert it to a URDF first.", name=name)
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(content, True)
        return builder.close()
    except (expat.ExpatError, ValueError, AssertionError, LookupError) as error:
        raise ModelError("{name} is not valid XML: {reason}.", name=name, reason=error) from error
