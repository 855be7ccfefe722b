"""JSON schemas of the messages in the form that recording viewers accept.

Viewers want `"type": "object"` at the top, no references, and one type per field: references are
replaced by what they refer to, and a field that may be null has the schema of its other type.
"""

import msgspec

Schema = dict[str, object]


def inlined_schema(message: type[msgspec.Struct]) -> bytes:
    """Self-contained JSON schema of a message type, as JSON."""
    (root,), definitions = msgspec.json.schema_components([message])
    return msgspec.json.encode(_inlined(root, definitions))


def _inlined(node: object, definitions: dict[str, Schema]) -> object:
    if isinstance(node, list):
        return [_inlined(item, definitions) for item in node]
    if not isinstance(node, dict):
        return node
    if isinstance(reference := node.get("$ref"), str):
        return _inlined(definitions[reference.rpartition("/")[2]], definitions)
    if isinstance(choices := node.get("anyOf"), list):
        (choice,) = [each for each in choices if each != {"type": "null"}]
        return _inlined(choice, definitions)
    return {key: _inlined(value, definitions) for key, value in node.items()}
