"""The OpenAPI document is valid and matches the original services."""

import asyncio
import base64
import hashlib
import json
import re
import sys
from pathlib import Path
from typing import Any

import httpx
import pytest

from arcor2_server.rest import OPERATIONS
from arcor2_server.rest.documents import document
from arcor2_server.rest.field_names import camel
from tests.protocol import openapi

SERVICES = {
    "storage": "Storage",
    "scene": "Scene",
    "build": "Build",
    "execution_proxy": "Execution",
    "calibration": "Calibration",
}
SNAKE = {"LineCheckResult", "MarkerCorners"}
"""Answers whose fields keep their names (protocol, section 14)."""


class Comparison:
    """Compares a schema of the original services with the schema of this server, and records the differences."""

    def __init__(self, original: dict[str, Any], actual: dict[str, Any]) -> None:
        self.parts = original["components"]["schemas"], actual["components"]["schemas"]
        self.differences: list[str] = []
        self.seen: set[str] = set()

    def resolved(self, schema: dict[str, Any], side: int) -> dict[str, Any]:
        """Return a schema with references and base schemas resolved."""
        if "$ref" in schema:
            schema = self.parts[side][schema["$ref"].rpartition("/")[2]]
        merged: dict[str, Any] = {"properties": {}, "required": []}
        for part in schema.get("allOf", ()):
            base = self.resolved(part, side)
            merged["properties"] |= base.get("properties", {})
            merged["required"] += base.get("required", [])
            merged |= {key: value for key, value in base.items() if key not in merged}
        merged["properties"] |= schema.get("properties", {})
        merged["required"] += schema.get("required", [])
        return merged | {key: value for key, value in schema.items() if key not in ("properties", "required", "allOf")}

    def same(self, where: str, original: dict[str, Any], actual: dict[str, Any]) -> None:
        name = original.get("$ref", "").rpartition("/")[2]
        if name and (name, where.startswith("body")) in self.seen:
            return
        self.seen.add((name, where.startswith("body")))  # type: ignore[arg-type]
        original, actual = self.resolved(original, 0), self.resolved(actual, 1)
        if original.get("type", "object") != actual.get("type", "object"):
            self.differences.append(f"{where}: {actual.get('type')} for {original.get('type')}")
        if "enum" in original and set(original["enum"]) != set(actual.get("enum", ())):
            self.differences.append(f"{where}: {actual.get('enum')} for {original['enum']}")
        if "items" in original:
            self.same(f"{where}[]", original["items"], actual["items"])
        rename = (lambda key: key) if name in SNAKE else camel
        needed = {rename(key) for key in original["required"]}
        if needed != set(actual["required"]) and original["properties"]:
            self.differences.append(f"{where}: needs {sorted(actual['required'])}, not {sorted(needed)}")
        if {rename(key) for key in original["properties"]} - set(actual["properties"]):
            self.differences.append(
                f"{where}: has {sorted(actual['properties'])}, not {sorted(original['properties'])}"
            )
            return
        for key, part in original["properties"].items():
            self.same(f"{where}.{key}", part, actual["properties"][rename(key)])


@pytest.mark.parametrize("name", SERVICES)
def test_the_document_matches_the_original_operations(name: str) -> None:
    original = openapi(name)
    actual = document(SERVICES[name])
    compare = Comparison(original, actual)
    differences = compare.differences
    for path, operations in original["paths"].items():
        for method, original_operation in operations.items():
            where = f"{method} {path}"
            operation = actual["paths"].get(path, {}).get(method)
            if operation is None:
                differences.append(f"{where} is missing")
                continue
            parameters = {one["name"]: one for one in operation["parameters"]}
            for wanted in original_operation.get("parameters", ()):
                # A path parameter may have any name; a query parameter may not.
                found = parameters.get(wanted["name"])
                if found is None or found["in"] != wanted["in"]:
                    differences.append(f"{where}: the parameter {wanted['name']} is missing")
                elif found["schema"].get("type") != wanted["schema"]["type"]:
                    differences.append(f"{where}: {wanted['name']} is {found['schema']}")
                elif wanted.get("required") and not found["required"]:
                    differences.append(f"{where}: {wanted['name']} is not required")
            for kind, content in original_operation.get("requestBody", {}).get("content", {}).items():
                got = operation["requestBody"]["content"][kind]["schema"]
                if kind == "application/json":
                    compare.same(f"body of {where}", content["schema"], got)
                else:
                    assert set(got["properties"]) == set(content["schema"]["properties"])
            for kind, content in original_operation["responses"]["200"].get("content", {}).items():
                got = operation["responses"]["200"]["content"][kind]["schema"]
                if "oneOf" in content["schema"]:
                    for one, other in zip(content["schema"]["oneOf"], got["oneOf"], strict=True):
                        compare.same(f"answer of {where}", one, other)
                else:
                    compare.same(f"answer of {where}", content["schema"], got)
    assert differences == []


@pytest.mark.parametrize("service", ["", *SERVICES.values()])
def test_the_document_is_valid(service: str) -> None:
    import schemathesis  # not by each worker that collects the tests

    made = document(service)
    assert made["paths"]
    assert made["openapi"].startswith("3.0")
    schemathesis.openapi.from_dict(made).validate()


def test_every_operation_is_documented_once() -> None:
    made = document()
    found = {(method.upper(), path) for path, operations in made["paths"].items() for method in operations}
    assert found == {(one.method, one.path) for one in OPERATIONS}
    assert len(found) == len(OPERATIONS)
    names = [operation["operationId"] for operations in made["paths"].values() for operation in operations.values()]
    assert len(names) == len(set(names))


async def test_the_command_line_prints_the_document(tmp_path: Path) -> None:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "arcor2_server.cli.main", "serve", "--openapi"),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        cwd=tmp_path,
        env={"HOME": str(tmp_path), "PATH": ""},
    )
    out, err = await process.communicate()
    assert (process.returncode, err) == (0, b"")
    assert json.loads(out) == document()
    assert list(tmp_path.iterdir()) == [], "the command creates no files"


async def test_the_documentation_page_needs_no_foreign_resources(http: httpx.AsyncClient) -> None:
    answer = await http.get("/swagger")
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/html")
    text = answer.text
    assert not re.findall(r"(?:src|href)\s*=", text)
    policy = re.findall(r'Content-Security-Policy" content="([^"]*)"', text)[0]
    assert policy.startswith("default-src 'none'; connect-src 'self';")
    for kind in ("style", "script"):
        (content,) = re.findall(rf"<{kind}>(.*?)</{kind}>", text, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()
        assert f"{kind}-src 'sha256-{digest}'" in policy
        assert "http" not in content
    assert "innerHTML" not in text
    # The resources that the page loads exist.
    assert (await http.get("/swagger/api/swagger.json")).json()["paths"]["/swagger"]
