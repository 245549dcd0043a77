"""The messages of a recording, written to an MCAP file with the Python package `mcap`."""

import json

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from row import Row, repeat


def read(path: str) -> list[tuple]:
    with open(path, "rb") as file:
        return [
            (schema.name, schema.data, channel.topic, message.log_time, json.loads(message.data))
            for schema, channel, message in make_reader(file).iter_messages(log_time_order=False)
        ]


def write(path: str, messages: list[tuple]) -> None:
    with open(path, "wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start(library="mcap for Python")
        channels: dict[str, int] = {}
        for name, schema, topic, time_ns, content in messages:
            if topic not in channels:
                number = writer.register_schema(name, "jsonschema", schema)
                channels[topic] = writer.register_channel(topic, "json", number)
            data = json.dumps(content, separators=(",", ":")).encode()
            writer.add_message(channels[topic], time_ns, data, time_ns)
        writer.finish()


def rows(problem: dict) -> list[Row]:
    messages = read(problem["recordings"]["mcap"])
    path = "out/bench/peer.mcap"
    write(path, messages)
    assert read(path) == messages, "the peer's file has other messages"
    work = repeat(lambda: write(path, messages))
    return [Row(f"MCAP, {len(messages)} messages", "mcap", "Python's mcap", work)]
