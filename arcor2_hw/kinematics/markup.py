"""XML from outside: without document types, so that nothing is fetched and nothing grows. Imports no numerics."""

from typing import Final
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from arcor2_hw.kinematics.errors import ModelError, UnsafeDescription

MAX_DEPTH: Final = 64


def parse_xml(content: bytes, name: str) -> Element:
    """Give the root of a document. Raises ModelError when it is none, UnsafeDescription for a document type.

    Without document types there are no entities, so that nothing is fetched and nothing grows.
    """
    parser = expat.ParserCreate()
    builder = TreeBuilder()
    depth = 0

    def refuse(*_: object) -> None:
        raise UnsafeDescription(f"{name} has a document type or an entity, which is refused.")

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise UnsafeDescription(f"{name} is nested deeper than {MAX_DEPTH} elements.")
        if tag.startswith("xacro:"):
            raise ModelError(f"{name} is a xacro: expand it into a URDF first.")
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
        raise ModelError(f"{name} is no XML: {error}.") from error
