"""The OpenAPI documents of all operations and of each service, generated from the declared operations."""

import functools
import typing
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any, Final

import msgspec

from arcor2_hw.data.role import Role
from arcor2_server.rest.field_names import camel
from arcor2_server.rest.operations import OPERATIONS, Operation, operation
from arcor2_server.rest.responses import WebApiError
from arcor2_server.settings import ServerSettings

OPENAPI: Final = "3.0.3"
_REFERENCE: Final = "#/components/schemas/{name}"
_TIMESTAMP: Final = r"^\d{4}-"


def document(service: str = "") -> dict[str, Any]:
    """Return the OpenAPI document of one service, by default of all."""
    chosen = [one for one in OPERATIONS if service in ("", one.service)]
    schemas, components = _schemas(chosen)
    paths: dict[str, dict[str, Any]] = {}
    for one in chosen:
        paths.setdefault(one.path, {})[one.method.lower()] = _operation(one, schemas)
    return {
        "openapi": OPENAPI,
        "info": {"title": f"ARCOR2-HW {service}".strip(), "version": version("arcor2-hw")},
        "paths": paths,
        "components": {
            "schemas": components,
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
        },
    }


def _types(one: Operation) -> Iterable[tuple[Any, bool]]:
    """Return the types of an operation, each with whether its fields are snake_case on the wire."""
    if "body" in one.takes:
        yield one.takes["body"], False
    if one.media_type == "application/json" and one.gives not in (None, type(None)):
        # A union of Structs without tags has no schema of its own.
        for part in typing.get_args(one.gives) if _is_union(one.gives) else (one.gives,):
            yield part, one.plain


def _is_union(kind: Any) -> bool:
    return isinstance(kind, typing.get_origin(int | str) or ()) or type(kind).__name__ == "UnionType"


Schemas = dict[tuple[str, bool], dict[str, Any]]
"""Schemas by the representation of the type, and whether its fields are snake_case on the wire."""


def _schemas(chosen: list[Operation]) -> tuple[Schemas, dict[str, Any]]:
    """Return the schemas of all types, and the components that they refer to."""
    schemas: Schemas = {}
    components: dict[str, Any] = {}
    wanted = [pair for one in chosen for pair in _types(one)] + [(WebApiError, False)]
    queries = [one.takes["query"] for one in chosen if "query" in one.takes]
    for plain in (False, True):
        kinds = list({str(kind): kind for kind, is_plain in wanted if is_plain is plain}.values())
        made, parts = msgspec.json.schema_components(kinds, ref_template=_REFERENCE)
        for kind, schema in zip(kinds, made, strict=True):
            schemas[str(kind), plain] = _to_openapi(schema, plain)
        for name, part in parts.items():
            components[name] = _to_openapi(part, plain)
    for query in queries:
        made, parts = msgspec.json.schema_components([query], ref_template=_REFERENCE)
        schemas[str(query), True] = _to_openapi(parts[query.__name__], True)
    return schemas, components


def _to_openapi(schema: Any, plain: bool) -> Any:
    """Convert a schema from JSON Schema 2020-12 to OpenAPI 3.0, with the names of fields as on the wire."""
    if isinstance(schema, list):
        return [_to_openapi(item, plain) for item in schema]
    if not isinstance(schema, dict):
        return schema
    converted: dict[str, Any] = {}
    for key, value in schema.items():
        match key:
            case "properties":
                converted[key] = {
                    name if plain else camel(name): _to_openapi(item, plain) for name, item in value.items()
                }
            case "required":
                converted[key] = [name if plain else camel(name) for name in value]
            case "const":
                converted["enum"] = [value]
            case "anyOf" if {"type": "null"} in value:
                others = [_to_openapi(item, plain) for item in value if item != {"type": "null"}]
                converted |= {"nullable": True} | (others[0] if len(others) == 1 else {"anyOf": others})
            case "contentEncoding":
                converted["format"] = {"base64": "byte"}[value]
            case "exclusiveMinimum" | "exclusiveMaximum":
                converted |= {f"m{key[10:]}": value, key: True}
            case "default" | "enum":
                converted[key] = value
            case _:
                converted[key] = _to_openapi(value, plain)
    if str(converted.get("pattern", "")).startswith(_TIMESTAMP):
        converted["format"] = "date-time"
    if "type" not in converted and all(isinstance(value, str) for value in converted.get("enum", [None])):
        converted["type"] = "string"
    if converted.get("required") == []:
        del converted["required"]
    if "$ref" in converted and len(converted) > 1:
        reference = converted.pop("$ref")
        converted["allOf"] = [{"$ref": reference}]
    return converted


def _operation(one: Operation, schemas: Schemas) -> dict[str, Any]:
    text = (one.handler.__doc__ or "").strip()
    made: dict[str, Any] = {
        "tags": [one.service],
        "operationId": one.handler.__name__,
        "summary": text.splitlines()[0],
        "description": f"{' '.join(text.split())} Least role: {Role(one.role).name.lower()}.",
        "parameters": [
            {"name": name, "in": "path", "required": True, "schema": {"type": "string"}} for name in one.path_names
        ]
        + list(_query(one, schemas)),
        "responses": _responses(one, schemas),
    }
    if not one.open:
        made["security"] = [{"token": []}, {}]
    if "body" in one.takes:
        schema = schemas[str(one.takes["body"]), False]
        made["requestBody"] = {"required": True, "content": {"application/json": {"schema": schema}}}
    elif one.file:
        file: dict[str, Any] = {"type": "string", "format": "binary"}
        several = {"type": "array", "minItems": 1, "items": file}
        properties: dict[str, Any] = {one.file: several if "uploads" in one.takes else file}
        properties |= {name: {"type": "string", "description": "JSON"} for name in one.parts}
        schema = {"type": "object", "required": [one.file, *one.parts], "properties": properties}
        made["requestBody"] = {"required": True, "content": {"multipart/form-data": {"schema": schema}}}
    return made


def _query(one: Operation, schemas: Schemas) -> Iterable[dict[str, Any]]:
    if "query" not in one.takes:
        return
    schema = schemas[str(one.takes["query"]), True]
    required = schema.get("required", [])
    for name, part in schema["properties"].items():
        yield {"name": name, "in": "query", "required": name in required, "schema": part}


def _responses(one: Operation, schemas: Schemas) -> dict[str, Any]:
    good: dict[str, Any] = {"description": "Done."}
    if one.media_type == "application/json":
        good["content"] = {"application/json": {"schema": _result_schema(one, schemas)}}
    elif one.media_type != "text/plain":
        good["content"] = {one.media_type: {"schema": {"type": "string", "format": "binary"}}}
    refused = {"application/json": {"schema": schemas[str(WebApiError), False]}}
    reasons = {"default": "The request was refused. The body states the reason."}
    if one.takes.keys() & {"query", "body", "upload", "uploads"}:
        reasons["400"] = "The query or body is invalid."
    if not one.open:
        reasons |= {"401": "A token is needed.", "403": "The role is too low."}
    if one.path_names or one.takes.keys() & {"query", "body"}:
        reasons["404"] = "An item that the request names does not exist."
    reasons["409"] = "The present state does not allow the request."
    return {"200": good} | {
        status: {"description": text, "content": refused} for status, text in sorted(reasons.items())
    }


def _result_schema(one: Operation, schemas: Schemas) -> dict[str, Any]:
    if one.gives in (None, type(None)):
        return {"type": "string", "enum": ["ok"]}
    if _is_union(one.gives):
        return {"oneOf": [schemas[str(part), one.plain] for part in typing.get_args(one.gives)]}
    return schemas[str(one.gives), one.plain]


# ------------------------------------------------------------------------------------------------ routes
_cached_document = functools.lru_cache(maxsize=16)(document)


def service_at(settings: ServerSettings, port: int) -> str:
    """Return the service on a classic port, "" if it is not the port of a single service."""
    services = {one.service for one in OPERATIONS}
    return next((name for name, own in settings.classic_ports.items() if own == port and name in services), "")


SERVER: Final = "ARCOR2-HW"


@dataclass(frozen=True, slots=True)
class ApiDocumentOperations:
    """The OpenAPI documents."""

    _settings: ServerSettings

    @operation("GET", "/openapi", SERVER, Role.OPERATOR, plain=True)
    async def openapi(self) -> dict[str, Any]:
        """Return the OpenAPI document of all services."""
        return _cached_document()

    @operation("GET", "/openapi/openapi.json", SERVER, Role.OPERATOR, plain=True)
    async def openapi_file(self) -> dict[str, Any]:
        """Return the OpenAPI document of all services."""
        return _cached_document()

    @operation("GET", "/swagger/api/swagger.json", SERVER, Role.OPERATOR, plain=True)
    async def swagger(self, port: int) -> dict[str, Any]:
        """Return the OpenAPI document of all services, on a classic port that of its service."""
        return _cached_document(service_at(self._settings, port))
