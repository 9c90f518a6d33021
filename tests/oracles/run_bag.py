#!/usr/bin/env python3
"""Reads the bag of a run with the readers of others: rosbags, mcap, mcap_ros2.

Run:
    python3 -m venv .venv && .venv/bin/pip install -r .ci/oracle-requirements.txt
    .venv/bin/python tests/oracles/run_bag.py BAG...

Every topic has the same count as a directory and as a bare file, every
message decodes by the definition in the bag, and what a run must hold is
there. Exit status 0 if all agree.
"""

import sys
from collections import Counter
from pathlib import Path

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader

# What every recorded run must hold, by the end of its name.
EXPECTED = [
    "program", "program/chunks", "programmed_contour", "programmed_contour/chunks",
    "compensated_path", "compensated_path/chunks", "compensation_report", "tool_table",
    "machine_state", "controller_traffic", "command_log", "node_parameters",
    "run_program/_action/status",
]
# Topics that older bags hold under an earlier name.
FORMERLY = {"command_log": "commands"}


def check(bag):
    (file,) = bag.glob("*.mcap")
    with Reader(bag) as reader:
        by_directory = {c.topic: c.msgcount for c in reader.connections}
    with AnyReader([file]) as reader:
        by_file = Counter(c.topic for c, _, _ in reader.messages())
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
    assert {t: n for t, n in by_directory.items() if n} == dict(by_file), (by_directory, by_file)

    decoded = Counter()
    with file.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        factory = DecoderFactory()
        for schema, channel, message in reader.iter_messages():
            assert schema.data, f"{schema.name} has no definition"
            assert channel.metadata["topic_type_hash"].startswith("RIHS01_"), channel.topic
            factory.decoder_for(channel.message_encoding, schema)(message.data)
            decoded[channel.topic] += 1
    for name in EXPECTED:
        names = {"/" + name, "/" + FORMERLY.get(name, name)}
        assert any(t.endswith(tuple(names)) and n for t, n in by_file.items()), f"no {name}"
    print(f"{bag}: {sum(by_file.values())} messages on {len(by_file)} topics, "
          f"{sum(decoded.values())} decoded by mcap_ros2")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    for name in sys.argv[1:]:
        check(Path(name))
