"""Prints the JSON schema of a certificate from what the check declares; it says what may stand where.

python -m ptcc_certify.certificate.json_schema
"""

from __future__ import annotations

import json
from dataclasses import is_dataclass
from fractions import Fraction
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from ptcc_certify.checker import OBLIGATIONS, SCHEMA
from ptcc_certify.checker.contents import BRINGS, FamilyCertificate, GraphCertificate
from ptcc_certify.checker.section_declarations import Brings, Pattern, Rule, declared, outermost
from ptcc_certify.checker.side_files import Numbers

Schema = dict[str, Any]
#: The grammar of exact numbers, section 3 of the format.
NUMBER = "|".join(
    [
        r"[+-]?[0-9]+(?:/0*[1-9][0-9]*)?",
        r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?0{0,2}(?:400|[0-3]?[0-9]{1,2}))?",
        r"[+-]?0[xX][0-9a-fA-F]+(?:\.[0-9a-fA-F]*)?[pP][+-]?0?(?:1400|1[0-3][0-9]{2}|0?[0-9]{1,3})",
    ]
)
_TYPES = {int: "integer", bool: "boolean", str: "string", dict: "object", NoneType: "null", None: "null"}


def json_schema() -> Schema:
    """Return the JSON schema of a certificate.

    Examples
    --------
    >>> json_schema()["$defs"]["Packets"]["required"]
    ['period', 'losses']
    """
    defs: dict[str, Schema] = _common()
    graph, family = (_schema(kind, defs) for kind in (GraphCertificate, FamilyCertificate))
    defs["obligation"] = {
        "anyOf": [_obligation(kind, one, defs) for kind in OBLIGATIONS for one in BRINGS.get(kind, (Brings(),))]
    }
    signal = {"properties": {"problem": {"type": "object", "required": ["signal"]}}, "required": ["problem"]}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": SCHEMA,
        "title": "Certificate of prescribed-time coordination control on a signed digraph, or on a family of them",
        "description": "What may stand where; FORMAT.md says what must be verified.",
        **{"if": signal, "then": family, "else": graph},
        "$defs": defs,
    }


def _object(properties: Schema, required: list[str]) -> Schema:
    return {"type": "object", "properties": properties, "required": required, "additionalProperties": False}


def _array(items: Schema) -> Schema:
    return {"type": "array", "items": items}


def _ref(name: str) -> Schema:
    return {"$ref": f"#/$defs/{name}"}


def _text(pattern: str) -> Schema:
    return {"type": "string", "pattern": f"^(?:{pattern})(?![\\s\\S])"}


def _by_label(each: Schema) -> Schema:
    return {"type": "object", "additionalProperties": each}


def _common() -> dict[str, Schema]:
    """Return what stands in many places."""
    file = {"file": _text("[A-Za-z0-9_.-]{1,200}"), "sha256": _text("[0-9a-f]{64}")}
    vector = {**file, "count": {"type": "integer", "minimum": 0}}
    number, whole = _ref("number"), _object(vector, list(vector))
    return {
        "number": {**_text(NUMBER), "maxLength": 4000},
        "interval": {"anyOf": [number, _object({"mid": number, "radius": number}, ["mid", "radius"])]},
        "side_file": _object(file, list(file)),
        "side_integers": whole,
        "side_numbers": {"anyOf": [whole, _object({**vector, "scale": number}, [*vector, "scale"])]},
        "integers": {"anyOf": [_array({"type": "integer"}), _ref("side_integers")]},
        "numbers": {"anyOf": [_array(number), _ref("side_numbers")]},
        "nodes": {"anyOf": [_array({"type": "string"}), _ref("side_integers")]},
        "number_by_agent": _by_label(number),
        "numbers_by_agent": {"anyOf": [_ref("number_by_agent"), _ref("side_numbers")]},
        "ends_by_agent": {
            "anyOf": [
                _by_label(_ref("interval")),
                _object({key: _ref("side_numbers") for key in ("mid", "radius")}, ["mid", "radius"]),
            ]
        },
        "triangle": _array(_array(number)),
    }


#: What an annotation stands for that says all.
_NAMED = {
    "a ball": "interval",
    "lower triangle": "triangle",
    "numbers": "numbers",
    "numbers of followers": "numbers",
    "numbers of edges": "numbers",
    "integers": "integers",
    "integers of followers": "integers",
    "a column": "side_file",
    "many nodes": "nodes",
    "ends by agent": "ends_by_agent",
}


def _schema(kind: Any, defs: dict[str, Schema]) -> Schema:
    """Return the schema of a declaration; sections stand in ``defs``."""
    origin, args = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        return {"anyOf": [_schema(one, defs) for one in args]}
    if origin is Annotated:
        return _annotated(*outermost(kind), kind, defs)
    if origin is tuple:
        parts = [_schema(one, defs) for one in args]
        return {"type": "array", "prefixItems": parts, "items": False, "minItems": len(parts)}
    if origin is Literal:
        return {"const": args[0]} if len(args) == 1 else {"enum": list(args)}
    if origin is list:
        return _array(_ref("obligation"))
    if kind is Fraction:
        return _ref("number")
    if isinstance(kind, type) and is_dataclass(kind):
        return _section(kind, defs)
    return {"type": _TYPES[origin or kind]}


def _section(section: type, defs: dict[str, Schema]) -> Schema:
    name = section.__name__
    if name not in defs:
        defs[name] = {}  # its place
        known = declared(section)
        kinds = {f.key: _without_null(f.kind) if f.optional else f.kind for f in known}
        properties = {key: _schema(kind, defs) for key, kind in kinds.items()}
        required = [f.key for f in known if not f.optional]
        defs[name] = {"description": (section.__doc__ or "").partition("\n")[0], **_object(properties, required)}
        if one_of := getattr(section, "one_of", ()):
            defs[name]["oneOf"] = [{"required": [key]} for key in one_of]
    return _ref(name)


def _without_null(kind: Any) -> Any:
    """Return what stands where a key is not left out."""
    return Union[tuple(one for one in get_args(kind) if one is not NoneType)]  # noqa: UP007


def _annotated(inner: Any, note: Any, kind: Any, defs: dict[str, Schema]) -> Schema:
    if isinstance(note, Rule) or note == "unread":
        return _schema(inner, defs)
    if isinstance(note, Pattern):
        return _text(note.text)
    if note == "nodes":
        return _array({"type": "string"})
    if note in _NAMED:
        return _ref(_NAMED[note])
    if note == "labels":
        return {"type": "array", "items": {"type": "string"}, "minItems": 1, "uniqueItems": True}
    if note == "a label":
        return {"type": "string"}
    if inner is Numbers:
        return _ref("number_by_agent" if "no file" in get_args(kind) else "numbers_by_agent")
    each = _schema(get_args(inner)[-1], defs)
    if note == "a list":
        return _array(each)
    return _by_label(each) | ({"propertyNames": {"pattern": "^[1-9][0-9]{0,8}$"}} if note == "by number" else {})


def _obligation(kind: str, brings: Brings, defs: dict[str, Schema]) -> Schema:
    proves, lemma = OBLIGATIONS[kind]
    names = brings.numbers.split()
    properties = {
        "kind": {"const": kind},
        "of": {"type": "string"},
        "proves": {"const": proves},
        "lemma": {"const": lemma},
    }
    if names:
        properties["numbers"] = _object({name: _ref("number") for name in names}, names)
    optional = NoneType in get_args(brings.witness)
    required = [*properties, *(["witness"] if brings.witness is not None and not optional else [])]
    if brings.witness is not None:
        properties["witness"] = _schema(_without_null(brings.witness) if optional else brings.witness, defs)
    return _object(properties, required)


if __name__ == "__main__":
    print(json.dumps(json_schema(), indent=1, ensure_ascii=False))
