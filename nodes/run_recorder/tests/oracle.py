#!/usr/bin/env python3
"""Reads a bag of ours with the readers of others.

Run:
    python3 -m venv .venv && .venv/bin/pip install mcap mcap-ros2-support rosbags
    cargo run -p run_recorder --example write_bag -- /tmp/bags 1000
    .venv/bin/python nodes/run_recorder/tests/oracle.py /tmp/bags/oracle 1000

Checks the counts by topic with `mcap`, `mcap_ros2` and `rosbags`, as a
directory and as a bare file, what the messages say, that the quality of
service in metadata.yaml and in the channels is the same, attachments and
metadata records. Exit status 0 if all agree.
"""

import io
import sys
from collections import Counter
from pathlib import Path

from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from ruamel.yaml import YAML

TOPICS = {
    "/mill/log": "std_msgs/msg/String",
    "/mill/tool": "geometry_msgs/msg/PointStamped",
    "/mill/silent": "std_msgs/msg/String",
}


def expected_counts(count):
    log = (count + 3) // 4
    return {"/mill/log": log, "/mill/tool": count - log}


def check_file(file, count):
    """The bare file, with the reference reader."""
    with file.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary.statistics.message_count == count
        assert {c.topic: summary.schemas[c.schema_id].name for c in summary.channels.values()} == TOPICS
        found = Counter()
        last = 0
        for _, channel, message, value in reader.iter_decoded_messages():
            assert message.sequence == found[channel.topic], (channel.topic, message.sequence)
            found[channel.topic] += 1
            assert message.log_time >= last
            last = message.log_time
            if channel.topic == "/mill/tool":
                assert value.point.x == value.header.stamp.sec
                assert (value.point.y, value.point.z) == (0.5, -1.0)
                assert value.header.frame_id == "work"
            else:
                assert value.data.startswith("line 0")
        assert found == expected_counts(count), found
        attachments = {a.name: a.data for a in reader.iter_attachments()}
        assert attachments == {"program.mpf": b"N10 G1 X5 F100\nM30\n"}, attachments
        records = {m.name: m.metadata for m in reader.iter_metadata()}
        assert records["cnc_run"]["run_id"] == "oracle"
        assert records["cnc_run_result"]["complete"] == "true"
        serialized = YAML(typ="safe").load(records["rosbag2"]["serialized_metadata"])
        qos = {
            c.topic: YAML(typ="safe").load(c.metadata["offered_qos_profiles"])
            for c in summary.channels.values()
        }
    with file.open("rb") as stream:
        records = sum(1 for _ in StreamReader(stream, validate_crcs=True).records)
        assert records > count
    return serialized, qos


def check_cut(file, count):
    """A file that breaks off before its index, with the streaming reader."""
    cut = file.read_bytes()[: file.stat().st_size * 3 // 4]
    found = 0
    try:
        for record in StreamReader(io.BytesIO(cut), validate_crcs=True).records:
            found += type(record).__name__ == "Message"
        raise AssertionError("the file has an end where it was cut")
    except AssertionError:
        raise
    except Exception:  # The end of the file comes as one of several kinds.
        assert 0 < found <= count, found
    return found


def check_rosbags(path, count):
    """Directory or bare file, with rosbags."""
    found = Counter()
    with Reader(path) as reader:
        assert {c.topic: c.msgtype for c in reader.connections} == TOPICS
        assert reader.message_count == count
        assert [c.ext.serialization_format for c in reader.connections] == ["cdr"] * 3
        qos = {c.topic: c.ext.offered_qos_profiles for c in reader.connections}
        for connection, _, _ in reader.messages():
            found[connection.topic] += 1
    assert found == expected_counts(count), (path, found)
    decoded = 0
    with AnyReader([path]) as reader:
        for connection, _, data in reader.messages():
            value = reader.deserialize(data, connection.msgtype)
            decoded += 1
            if connection.topic == "/mill/tool":
                assert value.point.x == value.header.stamp.sec
    assert decoded == count
    return qos


def check_split(directory, count):
    """A bag in several files: as a directory, and each file by itself."""
    files = sorted(directory.glob("*.mcap"), key=lambda file: (len(file.name), file.name))
    assert len(files) > 2, files
    own = 0
    for number, file in enumerate(files):
        with file.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            topics = [channel.topic for _, channel, _, _ in reader.iter_decoded_messages()]
            assert len(topics) == reader.get_summary().statistics.message_count
            records = [record.name for record in reader.iter_metadata()]
            assert records.count("cnc_run") == 1 and records[0] == "cnc_run_part", records
            assert ("cnc_run_result" in records) == (number + 1 == len(files))
        # What is latched comes again at the head of each file but the first.
        if number > 0:
            assert topics[0] == "/mill/log", topics[0]
        own += len(topics) - (number > 0)
        with Reader(file) as reader:
            assert reader.message_count == len(topics)
            assert sum(1 for _ in reader.messages()) == len(topics)
    assert own == count, own
    information = YAML(typ="safe").load((directory / "metadata.yaml").read_text())[
        "rosbag2_bagfile_information"
    ]
    assert information["relative_file_paths"] == [file.name for file in files]
    with Reader(directory) as reader:
        assert reader.message_count == count + len(files) - 1
        times = [time for _, time, _ in reader.messages()]
        assert len(times) == reader.message_count and times == sorted(times)
    with AnyReader([directory]) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
    return len(files)


def main():
    directory, count = Path(sys.argv[1]), int(sys.argv[2])
    file = directory / f"{directory.name}_0.mcap"
    serialized, channel_qos = check_file(file, count)
    print(f"mcap, mcap_ros2: {count} messages, attachment and metadata agree")
    print(f"cut off at three quarters: {check_cut(file, count)} messages are read")
    as_directory, as_file = check_rosbags(directory, count), check_rosbags(file, count)
    assert as_directory == as_file, "QoS as rosbags reads it differs"
    print(f"rosbags: {count} messages as directory and as file, the same QoS")
    whole = YAML(typ="safe").load((directory / "metadata.yaml").read_text())
    information = whole["rosbag2_bagfile_information"]
    assert information == serialized, "metadata.yaml and the rosbag2 record differ"
    for topic in information["topics_with_message_count"]:
        metadata = topic["topic_metadata"]
        assert (metadata["offered_qos_profiles"] or []) == (channel_qos[metadata["name"]] or [])
    assert information["custom_data"]["run_id"] == "oracle"
    files = check_split(directory.with_name(f"{directory.name}_split"), count)
    print(f"split: {files} files, alone and together")
    print("metadata.yaml: equals the rosbag2 record, QoS equals the channels'")


if __name__ == "__main__":
    main()
