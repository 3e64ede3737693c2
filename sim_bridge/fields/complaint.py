"""What is wrong with a JSON document, in one line: the field's path, what would be right, the value."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

_KIND = {
    "float": "a number",
    "int": "a whole number",
    "bool": "true or false",
    "array": "a list",
    "object": "an object",
    "null": "null",
}
_AT = re.compile(r"^(?P<what>.*?)(?: - at `\$\.?(?P<at>[^`]*)`)?$", re.DOTALL)


def complaint(message: str, document: Any, keys: Mapping[str, Sequence[str]]) -> str:
    """Msgspec's `message` about `document` -> "sources[0].amplitude: expected …, got …".

    `keys` are the known keys of each object by its path, list indices left out ("" is the document itself).
    """
    match = _AT.match(message)
    what, at = (message, "") if match is None else (match["what"], match["at"] or "")
    prefix = f"{at}." if at else ""
    if found := re.fullmatch(r"Object contains unknown field `(.*)`", what):
        known = ", ".join(keys.get(re.sub(r"\[\d+\]", "", at), ()))
        return f"{prefix}{found[1]}: unknown key, expected one of {known}"
    if found := re.fullmatch(r"Object missing required field `(.*)`", what):
        return f"{prefix}{found[1]}: missing"
    if found := re.fullmatch(r"Expected (.*), got .*", what):
        kinds = [_KIND.get(kind.strip(), kind.strip()) for kind in found[1].replace("`", "").split("|")]
        value = json.dumps(_value_at(document, at))
        return f"{at or 'scene'}: expected {' or '.join(kinds)}, got {value[:60]}"
    return f"{prefix}{what}"


def _value_at(document: Any, at: str) -> Any:
    for name, index in re.findall(r"([^.\[\]]+)|\[(\d+)\]", at):
        document = document[name] if name else document[int(index)]
    return document
