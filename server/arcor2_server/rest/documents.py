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
    chosen = [declared for declared in OPERATIONS if service in ("", declared.service)]
    schemas, components = _schemas(chosen)
    paths: dict[str, dict[str, Any]] = {}
    for declared in chosen:
        paths.setdefault(declared.path, {})[declared.method.lower()] = _operation(declared, schemas)
    return {
        "openapi": OPENAPI,
        "info": {"title": f"ARCOR2-HW {service}".strip(), "version": version("arcor2-hw")},
        "paths": paths,
        "components": {
            "schemas": components,
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
        },
    }


def _types(declared: Operation) -> Iterable[tuple[Any, bool]]:
    """Return the types of an operation, each with whether its fields are snake_case on the wire."""
    if "body" in declared.parameters:
        yield declared.parameters["body"], False
    if declared.media_type == "application/json" and declared.result not in (None, type(None)):
        # A union of Structs without tags has no schema of its own.
        for part in typing.get_args(declared.result) if _is_union(declared.result) else (declared.result,):
            yield part, declared.plain


def _is_union(kind: Any) -> bool:
    return isinstance(kind, typing.get_origin(int | str) or ()) or type(kind).__name__ == "UnionType"


Schemas = dict[tuple[str, bool], dict[str, Any]]
"""Schemas by the representation of the type, and whether its fields are snake_case on the wire."""


def _schemas(chosen: list[Operation]) -> tuple[Schemas, dict[str, Any]]:
    """Return the schemas of all types, and the components that they refer to."""
    schemas: Schemas = {}
    components: dict[str, Any] = {}
    wanted = [pair for declared in chosen for pair in _types(declared)] + [(WebApiError, False)]
    queries = [declared.parameters["query"] for declared in chosen if "query" in declared.parameters]
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


def _operation(declared: Operation, schemas: Schemas) -> dict[str, Any]:
    text = (declared.handler.__doc__ or "").strip()
    made: dict[str, Any] = {
        "tags": [declared.service],
        "operationId": declared.handler.__name__,
        "summary": text.splitlines()[0],
        "description": f"{' '.join(text.split())} Required role: {Role(declared.role).name.lower()}.",
        "parameters": [
            {"name": name, "in": "path", "required": True, "schema": {"type": "string"}} for name in declared.path_names
        ]
        + list(_query(declared, schemas)),
        "responses": _responses(declared, schemas),
    }
    if not declared.open:
        made["security"] = [{"token": []}, {}]
    if "body" in declared.parameters:
        schema = schemas[str(declared.parameters["body"]), False]
        made["requestBody"] = {"required": True, "content": {"application/json": {"schema": schema}}}
    elif declared.file:
        file: dict[str, Any] = {"type": "string", "format": "binary"}
        several = {"type": "array", "minItems": 1, "items": file}
        properties: dict[str, Any] = {declared.file: several if "uploads" in declared.parameters else file}
        properties |= {name: {"type": "string", "description": "JSON"} for name in declared.parts}
        schema = {"type": "object", "required": [declared.file, *declared.parts], "properties": properties}
        made["requestBody"] = {"required": True, "content": {"multipart/form-data": {"schema": schema}}}
    return made


def _query(declared: Operation, schemas: Schemas) -> Iterable[dict[str, Any]]:
    if "query" not in declared.parameters:
        return
    schema = schemas[str(declared.parameters["query"]), True]
    required = schema.get("required", [])
    for name, part in schema["properties"].items():
        yield {"name": name, "in": "query", "required": name in required, "schema": part}


def _responses(declared: Operation, schemas: Schemas) -> dict[str, Any]:
    good: dict[str, Any] = {"description": "Done."}
    if declared.media_type == "application/json":
        good["content"] = {"application/json": {"schema": _result_schema(declared, schemas)}}
    elif declared.media_type != "text/plain":
        good["content"] = {declared.media_type: {"schema": {"type": "string", "format": "binary"}}}
    refused = {"application/json": {"schema": schemas[str(WebApiError), False]}}
    reasons = {"default": "The request was refused. The body states the reason."}
    if declared.parameters.keys() & {"query", "body", "upload", "uploads"}:
        reasons["400"] = "The query or body is invalid."
    if not declared.open:
        reasons |= {"401": "A token is needed.", "403": "The role is too low."}
    if declared.path_names or declared.parameters.keys() & {"query", "body"}:
        reasons["404"] = "An item that the request names does not exist."
    reasons["409"] = "The present state does not allow the request."
    return {"200": good} | {
        status: {"description": text, "content": refused} for status, text in sorted(reasons.items())
    }


def _result_schema(declared: Operation, schemas: Schemas) -> dict[str, Any]:
    if declared.result in (None, type(None)):
        return {"type": "string", "enum": ["ok"]}
    if _is_union(declared.result):
        return {"oneOf": [schemas[str(part), declared.plain] for part in typing.get_args(declared.result)]}
    return schemas[str(declared.result), declared.plain]


# ------------------------------------------------------------------------------------------------ routes
_cached_document = functools.lru_cache(maxsize=16)(document)


def service_at(settings: ServerSettings, port: int) -> str:
    """Return the service on a classic port, "" if it is not the port of a single service."""
    services = {declared.service for declared in OPERATIONS}
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
