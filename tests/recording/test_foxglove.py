"""Recordings open in Foxglove: a third-party validator checks every message against Foxglove's JSON schemas."""

import json
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from npm import run_node
from test_mcap_file import write

from manipnet.recording.mcap_file import BODIES, TF

PACKAGES = ("@foxglove/schemas@2.1.0", "ajv@8.17.1")
VALIDATE = """
const Ajv = require('ajv'), {FrameTransforms} = require('@foxglove/schemas/jsonschema');
const read = name => JSON.parse(require('fs').readFileSync(name));
const [schemas, messages] = read(process.argv[1]), ajv = new Ajv({strict: false, logger: false});
const published = ajv.compile(FrameTransforms), wrong = [];
for (const [topic, message] of messages) {
    const own = ajv.validate(schemas[topic], message) ? [] : ajv.errors;
    const theirs = topic != '/tf' || published(message) ? [] : published.errors;
    if (own.length || theirs.length) wrong.push([topic, message, own, theirs]);
}
console.log(JSON.stringify({wrong, count: messages.length, published: FrameTransforms}));
"""


def bare(schema: Any) -> Any:
    """A schema without the parts that only people read."""
    if isinstance(schema, list):
        return [bare(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    return {key: bare(value) for key, value in schema.items() if key not in ("description", "$comment")}


@pytest.mark.parametrize("whole", [True, False])
def test_every_message_is_what_its_schema_says(tmp_path: Path, whole: bool) -> None:
    path = write(tmp_path / "take.mcap", 60)
    with path.open("rb") as file:
        read = [(schema, channel.topic, m.data) for schema, channel, m in make_reader(file).iter_messages([BODIES, TF])]
    schemas = {topic: json.loads(schema.data) for schema, topic, _ in read if schema is not None}
    messages = [(topic, json.loads(data)) for _, topic, data in read]
    if not whole:
        del messages[0][1]["bodies"], messages[1][1]["transforms"][0]["rotation"]
    (tmp_path / "messages.json").write_text(json.dumps([schemas, messages]))
    answer = run_node(VALIDATE, str(tmp_path / "messages.json"), packages=PACKAGES)
    assert answer["count"] == len(messages) == 150
    assert [topic for topic, *_ in answer["wrong"]] == ([] if whole else [BODIES, TF])
    assert schemas[TF] == bare(answer["published"])
