#!/usr/bin/env python3
"""Writes golden runs again with the writer of others, and has them replayed: rosbags.

Run:
    python3 -m venv .venv && .venv/bin/pip install -r .ci/oracle-requirements.txt
    .venv/bin/python tests/oracles/foreign_bags.py target/debug/kerf BAG...

The messages of a run are all that `kerf replay` needs of a bag: whatever its
version and its compression, and without any record of our recorder, it says
the same as of the bag that was recorded. Exit status 0 if so.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer

FORMS = [
    (version, mode)
    for version in (8, 9)
    for mode in (CompressionMode.NONE, CompressionMode.STORAGE, CompressionMode.FILE)
]


def write_again(bag, path, version, mode):
    """Copies every message with the topic's definition, hash and quality of service."""
    writer = Writer(path, version=version, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with Reader(bag) as reader, writer:
        connections = {}
        for connection in reader.connections:
            connections[connection.id] = writer.add_connection(
                connection.topic,
                connection.msgtype,
                msgdef=connection.msgdef.data,
                rihs01=connection.digest,
                offered_qos_profiles=connection.ext.offered_qos_profiles,
            )
        for connection, timestamp, data in reader.messages():
            writer.write(connections[connection.id], timestamp, data)


def replay(kerf, bag):
    """The exit status, and what is printed after the name of the bag."""
    ran = subprocess.run([kerf, "replay", bag], capture_output=True, text=True, timeout=120)
    said = ran.stdout.replace(str(bag), "BAG")
    return ran.returncode, said, ran.stderr.replace(str(bag), "BAG")


def main():
    kerf, bags = sys.argv[1], [Path(name) for name in sys.argv[2:]]
    assert bags, "which bags?"
    for bag in bags:
        expected = replay(kerf, bag)
        # Refusals in the same words would prove nothing.
        assert expected[0] in (0, 1), (bag, expected)
        with tempfile.TemporaryDirectory() as folder:
            for version, mode in FORMS:
                path = Path(folder) / f"{mode.name.lower()}_{version}"
                write_again(bag, path, version, mode)
                found = replay(kerf, path)
                assert found == expected, (bag, version, mode, found, expected)
        print(f"{bag}: {len(FORMS)} forms, each replays as the recorded one ({expected[0]})")


if __name__ == "__main__":
    main()
