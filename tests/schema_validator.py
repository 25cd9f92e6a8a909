"""The validator of the JSON schema of certificates, which tries alternatives only until they fail."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from jsonschema import Draft202012Validator, ValidationError  # type: ignore[import-untyped]
from jsonschema.validators import extend  # type: ignore[import-untyped]

from ptcc_certify.certificate.json_schema import json_schema


def _any_of(validator: Any, schemas: list[Any], value: Any, _: Any) -> Iterator[ValidationError]:
    """``anyOf`` without the list of all that keeps the value from each of them: a proof has many alternatives."""
    if not any(validator.evolve(schema=schema).is_valid(value) for schema in schemas):
        yield ValidationError(f"{value!r} is none of what may stand here")


VALIDATOR = extend(Draft202012Validator, {"anyOf": _any_of})(json_schema())
