"""Writes ``src/parfocal/interface.py`` from the description of the HTTP interface.

usage: python tools/generate_interface.py [--check]

Run it after a change of the interface (``make python-interface``). ``--check`` only compares.
"""

from __future__ import annotations

import json
import keyword
import re
import sys
import textwrap
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
DESCRIPTION = HERE.parent.parent / "web" / "types" / "openapi.json"
TARGET = HERE.parent / "src" / "parfocal" / "interface.py"

# What browsers use, and no program: pages, their files, redirects. /live is `frames()`.
LEFT_OUT = {
    "assets_asset",
    "roles_enter",
    "roles_start",
    "stream_live",
    "stream_mjpeg",
    "surgeon_worker",
    "trust_check",
    "trust_profile",
}

HEAD = '''\
"""The HTTP interface: its types, and a method for each of its requests.

Written by ``tools/generate_interface.py``. Do not edit.
"""

from __future__ import annotations

import builtins
import sys
from collections.abc import Awaitable, Callable
from typing import Any, Literal, TypedDict

if sys.version_info >= (3, 11):
    from typing import NotRequired
else:
    from typing_extensions import NotRequired

VERSION = "{version}"
"""The version of the server whose interface this is."""

'''


def main() -> int:
    api = json.loads(DESCRIPTION.read_text(encoding="utf-8"))
    text = Writer(api).module()
    if "--check" in sys.argv:
        if TARGET.read_text(encoding="utf-8") != text:
            print(f"{TARGET} does not match {DESCRIPTION.name}; run: make python-interface", file=sys.stderr)
            return 1
        return 0
    TARGET.write_text(text, encoding="utf-8")
    return 0


class Writer:
    def __init__(self, api: dict[str, Any]) -> None:
        self.api = api
        self.schemas: dict[str, Any] = api["components"]["schemas"]

    def module(self) -> str:
        parts = [HEAD.format(version=self.api["info"]["version"])]
        for name in sorted(self.schemas):
            parts.append(self.declaration(name))

        groups: dict[str, list[tuple[str, str, dict[str, Any]]]] = {}
        for path, methods in self.api["paths"].items():
            for method, operation in methods.items():
                answers = operation["responses"].items()
                content = [answer.get("content", {}) for status, answer in answers if status.startswith("2")]
                if operation["operationId"] in LEFT_OUT or any("text/html" in kinds for kinds in content):
                    continue
                groups.setdefault(operation["tags"][0], []).append((path, method, operation))

        for asynchronous in (False, True):
            for tag in sorted(groups):
                parts.append(self.group(tag, groups[tag], asynchronous))
            parts.append(self.all_groups(sorted(groups), asynchronous))
        return "\n".join(parts)

    # Types.

    def resolve(self, schema: dict[str, Any]) -> dict[str, Any]:
        while "$ref" in schema:
            schema = self.schemas[schema["$ref"].rsplit("/", 1)[1]]
        return schema

    def fields(self, schema: dict[str, Any]) -> dict[str, tuple[dict[str, Any], bool]] | None:
        """Return name, schema and whether it is required of an object's fields; None if they vary."""
        schema = self.resolve(schema)
        if "allOf" in schema:
            together: dict[str, tuple[dict[str, Any], bool]] = {}
            for part in schema["allOf"]:
                fields = self.fields(part)
                if fields is None:
                    return None
                together |= fields
            return together
        if schema.get("type") == "object" and "properties" in schema:
            required = schema.get("required", [])
            return {name: (field, name in required) for name, field in schema["properties"].items()}
        return None

    def type_of(self, schema: Any) -> str:
        if not isinstance(schema, dict):
            return "Any"
        if "$ref" in schema:
            return str(schema["$ref"].rsplit("/", 1)[1])
        if "enum" in schema:
            return "Literal[" + ", ".join(json.dumps(value) for value in schema["enum"]) + "]"
        for several in ("oneOf", "anyOf"):
            if several in schema:
                return " | ".join(dict.fromkeys(self.type_of(part) for part in schema[several]))
        kind = schema.get("type")
        if isinstance(kind, list):
            return " | ".join(self.type_of({**schema, "type": each}) for each in kind)
        match kind:
            case "string":
                return "str"
            case "integer":
                return "int"
            case "number":
                return "float"
            case "boolean":
                return "bool"
            case "null":
                return "None"
            case "array":
                return f"builtins.list[{self.type_of(schema.get('items', {}))}]"
            case "object":
                extra = schema.get("additionalProperties")
                return f"dict[str, {self.type_of(extra) if isinstance(extra, dict) else 'Any'}]"
        return "dict[str, Any]" if "allOf" in schema else "Any"

    def declaration(self, name: str) -> str:
        schema = self.schemas[name]
        about = docstring(schema.get("description", ""))
        fields = self.fields(schema)
        if fields is None:
            return f'{name} = {self.quoted(self.type_of(schema))}\n"""{about}"""\n'
        if any(keyword.iskeyword(field) or not field.isidentifier() for field in fields):
            inside = ", ".join(
                f'"{field}": "{self.field_type(part, required)}"'
                for field, (part, required) in fields.items()
            )
            return f'{name} = TypedDict("{name}", {{{inside}}})\n"""{about}"""\n'
        lines = [f"class {name}(TypedDict):", textwrap.indent(f'"""{about}"""', "    ")]
        for field, (part, required) in fields.items():
            lines.append(f"\n    {field}: {self.field_type(part, required)}")
            meaning = docstring(part.get("description", ""), 4) if isinstance(part, dict) else ""
            if meaning:
                lines.append(f'    """{meaning}"""')
        return "\n".join(lines) + "\n"

    def field_type(self, schema: dict[str, Any], required: bool) -> str:
        kind = self.type_of(schema)
        return kind if required else f"NotRequired[{kind}]"

    def quoted(self, kind: str) -> str:
        """Names that are declared further down must be quoted where they are evaluated."""
        return (
            json.dumps(kind)
            if re.search(r"\b[A-Z]\w+", kind.replace("Literal", "").replace("Any", ""))
            else kind
        )

    # Methods.

    def group(self, tag: str, operations: list[tuple[str, str, dict[str, Any]]], asynchronous: bool) -> str:
        kind = "Callable[..., Awaitable[Any]]" if asynchronous else "Callable[..., Any]"
        lines = [
            f"class {class_name(tag, asynchronous)}:",
            f'    """Requests of the group "{tag}"."""',
            "",
            f"    def __init__(self, call: {kind}) -> None:",
            "        self._call = call",
            "",
        ]
        for path, method, operation in operations:
            lines += [self.method(tag, path, method, operation, asynchronous), ""]
        return "\n".join(lines)

    def method(self, tag: str, path: str, method: str, operation: dict[str, Any], asynchronous: bool) -> str:
        name = operation["operationId"].removeprefix(f"{tag}_")
        positional = re.findall(r"{(\w+)}", path)
        arguments = [f"{part}: str | int" for part in positional]
        named: list[str] = []
        optional: list[str] = []
        query: list[str] = []
        for parameter in operation.get("parameters", []):
            if parameter["in"] != "query":
                continue
            query.append(parameter["name"])
            kind = self.type_of(parameter["schema"])
            if parameter.get("required"):
                named.append(f"{parameter['name']}: {kind}")
            else:
                kind = kind if "None" in kind else f"{kind} | None"
                optional.append(f"{parameter['name']}: {kind} = None")

        body: list[str] = []
        rest = False
        raw = False
        content = operation.get("requestBody", {}).get("content", {})
        if "application/json" in content:
            fields, rest = self.body_fields(content["application/json"]["schema"])
            for field, (schema, required) in fields.items():
                body.append(field)
                kind = self.type_of(schema)
                if required:
                    named.append(f"{field}: {kind}")
                else:
                    kind = kind if "None" in kind else f"{kind} | None"
                    optional.append(f"{field}: {kind} = None")
        elif content:
            raw = True
            named.append("content: bytes")
            named.append(f"media_type: {self.type_of({'enum': list(content)})}")

        separator = ["*"] if named or optional else []
        signature = ["self", *arguments, *separator, *named, *optional, *(["**fields: Any"] if rest else [])]
        answer, how = self.answer(operation)
        if asynchronous:
            answer = f"Awaitable[{answer}]"

        call = [json.dumps(method.upper()), ("f" if positional else "") + json.dumps(path)]
        if how != "json":
            call.append(f'answer="{how}"')
        if query:
            call.append("query={" + ", ".join(f'"{one}": {one}' for one in query) + "}")
        if body or rest:
            inside = ", ".join([*(f'"{one}": {one}' for one in body), *(["**fields"] if rest else [])])
            call.append(f"body={{{inside}}}")
        if raw:
            call.append("content=content, media_type=media_type")
        about = docstring(operation.get("summary") or operation.get("description") or "", 8)
        return "\n".join(
            [
                f"    def {name}({', '.join(signature)}) -> {answer}:",
                f'        """{about}"""',
                f"        return self._call({', '.join(call)})",
            ]
        )

    def body_fields(self, schema: dict[str, Any]) -> tuple[dict[str, tuple[dict[str, Any], bool]], bool]:
        """Return the fields that every body has, and whether there are others beside them."""
        schema = self.resolve(schema)
        fields: dict[str, tuple[dict[str, Any], bool]] = {}
        rest = False
        for part in schema.get("allOf", [schema]):
            known = self.fields(part)
            if known is None:
                rest = True
            else:
                fields |= known
        return fields, rest

    def answer(self, operation: dict[str, Any]) -> tuple[str, str]:
        for status, response in operation["responses"].items():
            if not status.startswith("2"):
                continue
            content = response.get("content", {})
            if "application/json" in content:
                return self.type_of(content["application/json"]["schema"]), "json"
            if "application/openmetrics-text" in content:
                return "str", "text"
            if operation["operationId"] == "service_openapi":
                return "dict[str, Any]", "json"
            if content:
                return "bytes", "bytes"
            return "None", "nothing"
        raise ValueError(f"{operation['operationId']} has no answer")

    def all_groups(self, tags: list[str], asynchronous: bool) -> str:
        kind = "Callable[..., Awaitable[Any]]" if asynchronous else "Callable[..., Any]"
        prefix = "Async" if asynchronous else ""
        lines = [
            f"class {prefix}Groups:",
            '    """All requests, in the groups of the interface."""',
            "",
            f"    def _make_groups(self, call: {kind}) -> None:",
        ]
        lines += [f"        self.{tag} = {class_name(tag, asynchronous)}(call)" for tag in tags]
        return "\n".join(lines) + "\n"


def class_name(tag: str, asynchronous: bool) -> str:
    return ("Async" if asynchronous else "") + tag.capitalize() + "Requests"


def docstring(text: str, indent: int = 0) -> str:
    text = " ".join(text.split()).replace("\\", "\\\\").replace('"""', "'''")
    if text.endswith('"'):
        text += " "
    lines = textwrap.wrap(text, 100 - indent)
    return f"\n{' ' * indent}".join(lines)


if __name__ == "__main__":
    sys.exit(main())
