"""The program of a fake: its options are the parameters of the function that builds the device."""

import inspect
from collections.abc import Awaitable, Callable
from typing import Annotated, Any

from cyclopts import App, Parameter

from arcor2_fakes.serving import serve

_CONTROL = inspect.Parameter(
    "control",
    inspect.Parameter.KEYWORD_ONLY,
    default="127.0.0.1:0",
    annotation=Annotated[str, Parameter(help="HOST:PORT of the control channel; port 0 takes a free one.")],
)
"""The option of all fakes."""


def program(name: str, about: str, *, ahead: bool = True) -> Callable[[Callable[..., Awaitable[None]]], App]:
    """Make the program of a fake from the function that builds it.

    The function takes the `Fake`, and the options as keywords; it awaits `Fake.run`. Its docstring describes the
    options. The option `--control` is added.

    Args:
        name: Name of the fake, for messages and the ready line.
        about: Description for `--help`.
        ahead: Whether to request a higher priority; see `process.run`.
    """

    def decorate(build: Callable[..., Awaitable[None]]) -> App:
        def command(*, control: str = str(_CONTROL.default), **options: Any) -> int:
            return serve(name, control, lambda fake: build(fake, **options), ahead=ahead)

        signature = inspect.signature(build, eval_str=True)
        options = [*list(signature.parameters.values())[1:], _CONTROL]
        command.__signature__ = signature.replace(parameters=options, return_annotation=int)  # type: ignore[attr-defined]
        command.__annotations__ = {option.name: option.annotation for option in options}
        command.__doc__ = build.__doc__
        app = App(name=f"arcor2_fakes.{name}", help=about, version_flags=[])
        app.default(command)
        return app

    return decorate
