"""The messages of a recording, written to an MCAP file with the Python package `mcap`."""

import json

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from row import Row, repeat


def decoded(channel, data: bytes):
    """Foxglove's own types are protobuf, and stay as they are."""
    return json.loads(data) if channel.message_encoding == "json" else data


def read(path: str) -> list[tuple]:
    with open(path, "rb") as file:
        return [
            (schema, channel, message.log_time, decoded(channel, message.data))
            for schema, channel, message in make_reader(file).iter_messages(log_time_order=False)
        ]


def write(path: str, messages: list[tuple]) -> None:
    with open(path, "wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start(library="mcap for Python")
        channels: dict[str, int] = {}
        for schema, channel, time_ns, content in messages:
            topic = channel.topic
            if topic not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[topic] = writer.register_channel(topic, channel.message_encoding, number)
            is_text = channel.message_encoding == "json"
            data = json.dumps(content, separators=(",", ":")).encode() if is_text else content
            writer.add_message(channels[topic], time_ns, data, time_ns)
        writer.finish()


def rows(problem: dict) -> list[Row]:
    messages = read(problem["recordings"]["mcap"])
    path = "out/bench/peer.mcap"
    write(path, messages)
    contents = [[each[2:] for each in all] for all in (read(path), messages)]
    assert contents[0] == contents[1], "the peer's file has other messages"
    work = repeat(lambda: write(path, messages))
    return [Row(f"MCAP, {len(messages)} messages", "mcap", "Python's mcap", work)]
