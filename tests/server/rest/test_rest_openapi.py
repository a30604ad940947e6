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
import schemathesis

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
    """Compares a schema of the original with ours and records the differences."""

    def __init__(self, theirs: dict[str, Any], ours: dict[str, Any]) -> None:
        self.parts = theirs["components"]["schemas"], ours["components"]["schemas"]
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

    def same(self, where: str, theirs: dict[str, Any], ours: dict[str, Any]) -> None:
        name = theirs.get("$ref", "").rpartition("/")[2]
        if name and (name, where.startswith("body")) in self.seen:
            return
        self.seen.add((name, where.startswith("body")))  # type: ignore[arg-type]
        theirs, ours = self.resolved(theirs, 0), self.resolved(ours, 1)
        if theirs.get("type", "object") != ours.get("type", "object"):
            self.differences.append(f"{where}: {ours.get('type')} for {theirs.get('type')}")
        if "enum" in theirs and set(theirs["enum"]) != set(ours.get("enum", ())):
            self.differences.append(f"{where}: {ours.get('enum')} for {theirs['enum']}")
        if "items" in theirs:
            self.same(f"{where}[]", theirs["items"], ours["items"])
        rename = (lambda key: key) if name in SNAKE else camel
        needed = {rename(key) for key in theirs["required"]}
        if needed != set(ours["required"]) and theirs["properties"]:
            self.differences.append(f"{where}: needs {sorted(ours['required'])}, not {sorted(needed)}")
        if {rename(key) for key in theirs["properties"]} - set(ours["properties"]):
            self.differences.append(f"{where}: has {sorted(ours['properties'])}, not {sorted(theirs['properties'])}")
            return
        for key, part in theirs["properties"].items():
            self.same(f"{where}.{key}", part, ours["properties"][rename(key)])


@pytest.mark.parametrize("name", SERVICES)
def test_the_document_matches_the_original_operations(name: str) -> None:
    theirs = openapi(name)
    ours = document(SERVICES[name])
    compare = Comparison(theirs, ours)
    differences = compare.differences
    for path, operations in theirs["paths"].items():
        for method, their in operations.items():
            where = f"{method} {path}"
            our = ours["paths"].get(path, {}).get(method)
            if our is None:
                differences.append(f"{where} is missing")
                continue
            parameters = {one["name"]: one for one in our["parameters"]}
            for wanted in their.get("parameters", ()):
                # A path parameter may have any name; a query parameter may not.
                found = parameters.get(wanted["name"])
                if found is None or found["in"] != wanted["in"]:
                    differences.append(f"{where}: the parameter {wanted['name']} is missing")
                elif found["schema"].get("type") != wanted["schema"]["type"]:
                    differences.append(f"{where}: {wanted['name']} is {found['schema']}")
                elif wanted.get("required") and not found["required"]:
                    differences.append(f"{where}: {wanted['name']} is not required")
            for kind, content in their.get("requestBody", {}).get("content", {}).items():
                got = our["requestBody"]["content"][kind]["schema"]
                if kind == "application/json":
                    compare.same(f"body of {where}", content["schema"], got)
                else:
                    assert set(got["properties"]) == set(content["schema"]["properties"])
            for kind, content in their["responses"]["200"].get("content", {}).items():
                got = our["responses"]["200"]["content"][kind]["schema"]
                if "oneOf" in content["schema"]:
                    for one, other in zip(content["schema"]["oneOf"], got["oneOf"], strict=True):
                        compare.same(f"answer of {where}", one, other)
                else:
                    compare.same(f"answer of {where}", content["schema"], got)
    assert differences == []


@pytest.mark.parametrize("service", ["", *SERVICES.values()])
def test_the_document_is_valid(service: str) -> None:
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
