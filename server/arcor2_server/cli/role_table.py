"""Generates docs/reference/roles.md: the role that each request, event and REST route needs."""

from collections.abc import Iterable
from typing import Any, cast

from litestar import Litestar

from arcor2_hw.data.events import EVENTS
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import RPCS, WITHOUT_PERSON
from arcor2_server.access.route_options import OPEN, OWN_TOKEN, ROLE

_HEAD = """# Roles

The minimum role for each request, event and route. Each role includes the permissions of the roles before it.
A client has the role of its token. At a shared device it has the lower role of the token and of the person who is
logged on ([persons](../protocol/persons.md)).
This page is generated from the declarations in the source:
`python -m arcor2_server.cli.role_table > docs/reference/roles.md`.
"""


def _table(title: str, rows: Iterable[tuple[str, Role]]) -> list[str]:
    lines = ["", f"## {title}", "", "| role | |", "|---|---|"]
    by_role: dict[Role, list[str]] = {role: [] for role in Role}
    for name, role in rows:
        by_role[role].append(name)
    return lines + [
        f"| {role.name.lower().replace('_', ' ')} | {', '.join(sorted(names))} |"
        for role, names in by_role.items()
        if names
    ]


def _routes(app: Litestar) -> Iterable[tuple[str, Role]]:
    for route in app.routes:
        for handler in cast("Any", route).route_handlers if hasattr(route, "route_handlers") else ():
            role = handler.opt.get(ROLE)
            open_to = handler.opt.get(OPEN)
            needed = "" if not open_to else f" ({open_to if open_to == OWN_TOKEN else 'no token'})"
            for method in sorted(handler.http_methods - {"OPTIONS", "HEAD"}):
                if isinstance(role, Role):
                    yield f"`{method} {route.path}`{needed}", role


def page(app: Litestar) -> str:
    """Return the Markdown page."""
    lines = _HEAD.splitlines()
    lines += _table("Requests", ((name, rpc.role) for name, rpc in RPCS.items()))
    lines += ["", "## Commands of a shared device while nobody is logged on", ""]
    lines += [", ".join(sorted(WITHOUT_PERSON)) + ". In addition every request of the role operator that only reads."]
    lines += _table("Events", ((name, event.role) for name, event in EVENTS.items()))
    lines += _table("REST", _routes(app))
    return "\n".join(lines) + "\n"


async def _main() -> None:
    import sys
    import tempfile
    from pathlib import Path

    from arcor2_server.app import create_app, running_server
    from arcor2_server.settings import ServerSettings

    with tempfile.TemporaryDirectory() as directory:
        async with running_server(ServerSettings(data_dir=Path(directory))) as server:
            sys.stdout.write(page(create_app(server)))


if __name__ == "__main__":
    import asyncio

    asyncio.run(_main())
