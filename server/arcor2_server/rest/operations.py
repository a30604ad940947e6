"""Declaration of REST operations. Routes and OpenAPI documents are generated from the signatures of the handlers."""

import asyncio
import inspect
import math
import secrets
import typing
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import IO, Any, Final, Literal, TypeVar
from urllib.parse import quote

import msgspec
import structlog
from litestar import MediaType, Request, Response
from litestar.datastructures import UploadFile
from litestar.enums import HttpMethod
from litestar.exceptions import HTTPException
from litestar.handlers import HTTPRouteHandler
from litestar.response import Stream

from arcor2_hw.data.audit import AuditOutcome
from arcor2_hw.data.role import Role
from arcor2_hw.data.texts import check_texts
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_server.access.route_options import AS_ROLE, OPEN, PERSON, ROLE, STOPS
from arcor2_server.audit.changes import Change, collecting
from arcor2_server.audit.commands import MAX_TARGET
from arcor2_server.audit.trail import ENDED_EARLY, AuditTrail
from arcor2_server.collaboration.tasks import Tasks
from arcor2_server.rest.field_names import camelized, camelized_names, snake, snaked
from arcor2_server.rest.responses import SERVICE, InternalError, Unsupported, refusal
from arcor2_server.rest.uploads import receiving
from arcor2_server.web.encodings import accepted_encodings

log = structlog.get_logger(__name__)
F = TypeVar("F", bound=Callable[..., Awaitable[Any]])

MIB: Final = 1024 * 1024
MAX_BODY: Final = 16 * MIB
"""Maximum size of a JSON body, as for a websocket message, bytes."""
MAX_FILES: Final = 200
"""Maximum number of files in one body."""
IN_THREAD_FROM: Final = 256 * 1024
"""Size of JSON above which it is decoded or encoded in a thread, bytes."""


class Binary(msgspec.Struct, frozen=True):
    """A file as the result of an operation: its content, or chunks of it with `size` bytes in total."""

    content: bytes | AsyncIterator[bytes]
    media_type: str
    filename: str
    size: int | None = None


class CacheableContent(msgspec.Struct, frozen=True):
    """A result that clients cache by its `etag`."""

    read: Callable[[bool], Awaitable[bytes]]
    """Returns the content, compressed by gzip if the argument is true."""
    media_type: str
    etag: str
    gzipped: bool = False
    """Whether the content is also available compressed by gzip."""


class Upload(msgspec.Struct):
    """The file of a multipart body, on disk if it is large. `fields` are the other parts."""

    file: IO[bytes]
    filename: str
    fields: dict[str, str]


class Uploads(msgspec.Struct):
    """The files with the same name in a multipart body, in their order. `fields` are the other parts."""

    files: list[IO[bytes]]
    fields: dict[str, str]


@dataclass(frozen=True, slots=True)
class Operation:
    """A REST operation.

    Parameters of the handler with these names are filled from the request: `query` (a Struct), `body` (a type that
    msgspec decodes), `upload`, `uploads`, `port` (the local port) and `person` (the name of the person who is logged
    on, else of the token; may be empty). All other parameters are parts of the path.
    """

    method: Literal["GET", "PUT", "POST", "DELETE"]
    path: str
    service: str
    role: Role
    handler: Callable[..., Awaitable[Any]]
    parameters: Mapping[str, Any]
    """Types of the parameters of the handler."""
    result: Any
    """Type of the result."""
    file: str = ""
    """Name of the part of a multipart body with the file."""
    parts: tuple[str, ...] = ()
    """Names of further required parts."""
    title: str = ""
    """Title of the task that reports the upload (TaskState); `{name}` is replaced by a part of the path."""
    shown_from: int = 0
    """Size of a body below which no task reports the upload, bytes."""
    limit: int = MAX_BODY
    """Maximum size of the body, bytes."""
    plain: bool = False
    """Whether the fields of the result are snake_case on the wire, as in later operations of the protocol."""
    open: bool = False
    """Whether the operation needs no token."""
    stops: bool = False
    """Whether a shared device may use it while nobody is logged on, since it stops something."""
    media_type: str = "application/json"
    """Media type of the result."""
    path_names: tuple[str, ...] = field(default=())
    """Names of the parameters in the path."""


SPECIAL: Final = frozenset({"query", "body", "upload", "uploads", "port", "person"})
"""Parameters of handlers that are not parts of the path."""
OPERATIONS: Final[list[Operation]] = []
"""All declared operations. Their handlers are unbound methods."""


def operation(
    method: Literal["GET", "PUT", "POST", "DELETE"], path: str, service: str, role: Role, **more: Any
) -> Callable[[F], F]:
    """Declare a method as the handler of an operation. `more`: further attributes of Operation."""

    def register(handler: F) -> F:
        hints = typing.get_type_hints(handler, include_extras=True)
        result = hints.pop("return")
        names = tuple(name for name in hints if name not in SPECIAL)
        if set(names) != {part[1:-1] for part in path.split("/") if part.startswith("{")}:
            raise TypeError(f"{method} {path}: the path and the parameters of {handler} differ")
        OPERATIONS.append(
            Operation(method, path, service, role, handler, hints, result, path_names=names, **more),
        )
        return handler

    return register


def bound(operations: Iterable[Operation], groups: Iterable[object]) -> Iterator[Operation]:
    """Return the operations with their handlers bound to the objects of their classes.

    Raises:
        KeyError: the object of a class is missing.
    """
    by_class = {type(group).__qualname__: group for group in groups}
    for declared in operations:
        owner, _, method = declared.handler.__qualname__.rpartition(".")
        yield replace(declared, handler=getattr(by_class[owner], method))


def route(declared: Operation, tasks: Tasks, audit: AuditTrail) -> HTTPRouteHandler:
    """Return the route of an operation.

    Args:
        declared: the operation, with a bound handler.
        tasks: the tasks, for the progress of uploads.
        audit: the audit trail.
    """

    def note(
        outcome: AuditOutcome, request: Request[Any, Any, Any], reason: str = "", changes: Sequence[Change] = ()
    ) -> None:
        """Record an operation in the audit trail, unless it only reads."""
        if declared.method == "GET":
            return
        audit.note(
            outcome,
            f"{declared.method} {declared.path}",
            target=", ".join(str(request.path_params[name]) for name in declared.path_names)[:MAX_TARGET],
            user=request.state.get(PERSON, ""),
            role=request.state.get(AS_ROLE),
            address=request.client.host if request.client else "",
            reason=reason,
            changes=changes,
        )

    async def handle(request: Request[Any, Any, Any]) -> Response[Any]:
        uploads: list[UploadFile] = []
        changes: list[Change] = []
        try:
            with receiving(request, tasks, declared.title, declared.shown_from), collecting() as changes:
                done = await declared.handler(**await _arguments(declared, request, uploads))
            note(AuditOutcome.DONE, request, changes=changes)
            return await _response(declared, request, done)
        except Arcor2Error as error:
            note(AuditOutcome.REFUSED, request, str(error))
            if error.detail:
                log.info("request refused", path=declared.path, reason=str(error)[:1000], detail=error.detail[:1000])
            return refusal(declared.service, error)
        except asyncio.CancelledError:
            if changes:
                note(AuditOutcome.REFUSED, request, ENDED_EARLY, changes)
            raise
        except HTTPException:
            raise
        except Exception:
            reference = secrets.token_hex(4)
            log.exception("request failed", method=declared.method, path=declared.path, reference=reference)
            error_inside = InternalError(
                "An error inside the server: see its log, reference {reference}.", reference=reference
            )
            note(AuditOutcome.REFUSED, request, str(error_inside))
            return refusal(declared.service, error_inside)
        finally:
            for upload in uploads:
                await upload.close()

    handle.__name__ = declared.handler.__name__
    handle.__doc__ = inspect.getdoc(declared.handler)
    options = {ROLE: declared.role, SERVICE: declared.service} | {STOPS: declared.stops}
    if declared.open:
        options[OPEN] = True
    return HTTPRouteHandler(
        "/".join(f"{part[:-1]}:str}}" if part.startswith("{") else part for part in declared.path.split("/")),
        http_method=HttpMethod(declared.method),
        status_code=200,
        opt=options,
        request_max_body_size=declared.limit,
        include_in_schema=False,
    )(handle)


async def _arguments(declared: Operation, request: Request[Any, Any, Any], uploads: list[UploadFile]) -> dict[str, Any]:
    given: dict[str, Any] = {name: request.path_params[name] for name in declared.path_names}
    for name, kind in declared.parameters.items():
        if name == "port":
            given[name] = (request.scope.get("server") or ("", 0))[1]
        elif name == "query":
            given[name] = _query(kind, request)
        elif name == "body":
            given[name] = await _body(kind, request)
        elif name == "upload":
            given[name] = await _upload(declared, request, uploads)
        elif name == "uploads":
            given[name] = await _uploads(declared, request, uploads)
        elif name == "person":
            given[name] = request.state.get(PERSON, "")
    return given


def _query(kind: Any, request: Request[Any, Any, Any]) -> Any:
    """Decode the query. Names may be camelCase or snake_case; unknown names are ignored."""
    fields = {field.name: field for field in msgspec.structs.fields(kind)}
    values: dict[str, Any] = {}
    for key, value in request.query_params.multi_items():
        name = snake(key)
        if name not in fields:
            continue
        if _is_list(fields[name].type):
            # Existing clients repeat the name, or separate the values by commas.
            values.setdefault(fields[name].encode_name, []).extend(part for part in value.split(",") if part)
        else:
            values[fields[name].encode_name] = value
    try:
        read = msgspec.convert(values, kind, strict=False)
    except msgspec.ValidationError as error:
        raise InvalidData("The query is wrong: {reason}.", reason=error) from None
    check_texts(read)
    for name in fields:
        value = getattr(read, name)
        for each in value if isinstance(value, list) else (value,):
            if isinstance(each, float) and not math.isfinite(each):
                raise InvalidData("The query is wrong: {name} is not a finite number.", name=name)
    return read


def _is_list(kind: Any) -> bool:
    return typing.get_origin(kind) is list or any(typing.get_origin(one) is list for one in typing.get_args(kind))


async def _body(kind: Any, request: Request[Any, Any, Any]) -> Any:
    media_type = request.content_type[0]
    # A body without a media type is accepted as JSON.
    if media_type and media_type != "application/json" and not media_type.endswith("+json"):
        raise Unsupported("The body must be application/json, not {media_type}.", media_type=media_type[:80])
    content = await request.body()
    if len(content) > IN_THREAD_FROM:
        return await asyncio.to_thread(_decoded, content, kind)
    return _decoded(content, kind)


def _decoded(content: bytes, kind: Any) -> Any:
    try:
        value = snaked(msgspec.json.decode(content))
        if b"\\u" in content:
            msgspec.json.encode(value)  # refuses lone surrogates, which can be neither stored nor sent back
        body = msgspec.convert(value, kind)
        check_texts(body)
    except (msgspec.DecodeError, RecursionError, UnicodeError) as error:
        raise InvalidData("The body is wrong: {reason}.", reason=camelized_names(str(error))) from None
    return body


async def _upload(declared: Operation, request: Request[Any, Any, Any], uploads: list[UploadFile]) -> Upload:
    parts, texts = await _multipart(declared, request, uploads)
    file = _as_file(dict(parts).get(declared.file), uploads)
    if file is None:
        raise InvalidData("The body has no file {file}.", file=declared.file)
    return Upload(typing.cast("IO[bytes]", file.file), file.filename, texts)


async def _uploads(declared: Operation, request: Request[Any, Any, Any], uploads: list[UploadFile]) -> Uploads:
    parts, texts = await _multipart(declared, request, uploads)
    named = [part for name, part in parts if name == declared.file]
    if len(named) > MAX_FILES:
        raise InvalidData(
            "The body has {count} files {file}. At most {most_files} are allowed.",
            count=len(named),
            file=declared.file,
            most_files=MAX_FILES,
        )
    files = [file for part in named if (file := _as_file(part, uploads)) is not None]
    if not files:
        raise InvalidData("The body has no file {file}.", file=declared.file)
    return Uploads([typing.cast("IO[bytes]", file.file) for file in files], texts)


async def _multipart(
    declared: Operation, request: Request[Any, Any, Any], uploads: list[UploadFile]
) -> tuple[list[tuple[str, Any]], dict[str, str]]:
    """Return all parts of a body in order, and the text parts."""
    if request.content_type[0] != "multipart/form-data":
        raise Unsupported("The body must be multipart/form-data with the file {file}.", file=declared.file)
    try:
        form = await request.form()
    except UnicodeDecodeError:
        raise InvalidData("A part of the body is neither text nor a file with a name.") from None
    parts = list(form.multi_items())
    uploads += [part for _, part in parts if isinstance(part, UploadFile)]
    last = dict(parts)
    for name in declared.parts:
        if name not in last:
            raise InvalidData("The body has no part {name}.", name=name)
    texts: dict[str, str] = {}
    for name, part in last.items():
        if isinstance(part, str):
            texts[name] = part
        elif name in declared.parts:
            texts[name] = (await part.read(MAX_BODY)).decode(errors="replace")
    return parts, texts


def _as_file(part: Any, uploads: list[UploadFile]) -> UploadFile | None:
    if isinstance(part, str):
        # A part without a file name was decoded as text.
        part = UploadFile("application/octet-stream", "", part.encode())
        uploads.append(part)
    return part if isinstance(part, UploadFile) else None


async def _response(declared: Operation, request: Request[Any, Any, Any], given: Any) -> Response[Any]:
    if isinstance(given, CacheableContent):
        return await _cacheable(request, given)
    if isinstance(given, Binary):
        # RFC 6266: the name is encoded as UTF-8, since it may have any characters.
        headers = {"Content-Disposition": f"attachment; filename*=UTF-8''{quote(given.filename, safe='')}"}
        if isinstance(given.content, bytes):
            return Response(given.content, media_type=given.media_type, headers=headers)
        if given.size is not None:
            headers["Content-Length"] = str(given.size)
        return Stream(given.content, media_type=given.media_type, headers=headers)
    if declared.media_type != "application/json":
        return Response(given, media_type=declared.media_type)
    content = msgspec.json.encode("ok" if given is None else given)
    if not declared.plain:
        content = await asyncio.to_thread(_renamed, content) if len(content) > IN_THREAD_FROM else _renamed(content)
    return Response(content, media_type=MediaType.JSON)


async def _cacheable(request: Request[Any, Any, Any], given: CacheableContent) -> Response[Any]:
    gzipped = given.gzipped and "gzip" in accepted_encodings(request)
    # Each encoding is a separate representation and needs its own tag.
    etag = f'{given.etag[:-1]}.gz"' if gzipped else given.etag
    headers = {"ETag": etag, "Cache-Control": "no-cache", "Vary": "Accept-Encoding"}
    known = [each.strip().removeprefix("W/") for each in request.headers.get("if-none-match", "").split(",")]
    if etag in known:
        return Response(b"", status_code=304, media_type=given.media_type, headers=headers)
    if gzipped:
        headers["Content-Encoding"] = "gzip"
    return Response(await given.read(gzipped), media_type=given.media_type, headers=headers)


def _renamed(content: bytes) -> bytes:
    return msgspec.json.encode(camelized(msgspec.json.decode(content)))
