"""Python source is parsed while another thread parses."""

import ast
import gc
from collections.abc import Iterator

import pytest

from arcor2_hw.parsing import parse, parse_expression

SOURCE = "\n".join(f"x{number} = [{number}, {{}}]" for number in range(2000))


@pytest.fixture
def nested() -> Iterator[list[str]]:
    """Provide a finalizer that parses once during another parse, like another thread. Yields its result."""
    parsed: list[str] = []

    def finalize(phase: str, _: dict[str, int]) -> None:
        if not parsed:
            parsed.append(phase)
            ast.parse("1")

    threshold, enabled = gc.get_threshold(), gc.isenabled()
    gc.collect()
    gc.callbacks.append(finalize)
    gc.set_threshold(500)
    gc.enable()  # a test of a failed start may have left it disabled
    yield parsed
    if not enabled:
        gc.disable()
    gc.set_threshold(*threshold)
    gc.callbacks.remove(finalize)


def test_a_source_is_parsed_during_another_parse(nested: list[str]) -> None:
    assert len(parse(SOURCE).body) == 2000
    assert nested, "nothing else has parsed meanwhile"


def test_an_expression_is_parsed_during_another_parse(nested: list[str]) -> None:
    expression = parse_expression("[" + "{}, " * 2000 + "]")
    assert isinstance(expression, ast.List)
    assert nested, "nothing else has parsed meanwhile"


@pytest.mark.parametrize("source", ["x = ", "(" * 500 + ")" * 500, "\0"])
def test_errors_of_the_source_are_raised(source: str) -> None:
    with pytest.raises((SyntaxError, ValueError, RecursionError, MemoryError)):
        parse(source)
