"""The rows of a recording, logged to a file with rerun's Python SDK, from Arrow arrays that are ready-made."""

import rerun
from rerun.experimental import RrdReader

from row import Row, repeat


def read(path: str) -> list[tuple]:
    """Each row as its entity, times and components."""
    rows = []
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        if chunk.entity_path.startswith("/__properties"):
            continue
        kinds = [(field.metadata or {}).get(b"rerun:kind") for field in batch.schema]
        for index in range(batch.num_rows):
            times, components = [], []
            for column, field, kind in zip(batch.columns, batch.schema, kinds):
                if kind == b"index":
                    times.append((field.name, column[index].as_py()))
                elif kind == b"data" and column[index].is_valid:
                    components.append(rerun.AnyBatchValue(descriptor(field), column[index].values))
            rows.append((chunk.entity_path, times, components))
    return rows


def descriptor(field) -> rerun.ComponentDescriptor:
    told = {key.decode(): value.decode() for key, value in field.metadata.items()}
    return rerun.ComponentDescriptor(
        told["rerun:component"], told.get("rerun:archetype"), told.get("rerun:component_type")
    )


def write(path: str, rows: list[tuple]) -> None:
    recording = rerun.RecordingStream("elastocal", recording_id="peer", send_properties=False)
    recording.set_log_time_enabled(False)
    recording.set_log_tick_enabled(False)
    recording.save(path)
    for entity, times, components in rows:
        recording.reset_time()
        for timeline, place in times:
            recording.set_time(timeline, sequence=place)
        recording.log(entity, components, static=not times)
    recording.flush()
    recording.disconnect()


def content(rows: list[tuple]) -> list[str]:
    return sorted(
        repr((entity, sorted(times), sorted((str(c.descriptor), c.pa_array.to_pylist()) for c in components)))
        for entity, times, components in rows
    )


def rows(problem: dict) -> list[Row]:
    logged = read(problem["recordings"]["rrd"])
    path = "out/bench/peer.rrd"
    write(path, logged)
    assert content(read(path)) == content(logged), "the peer's file has other rows"
    work = repeat(lambda: write(path, logged))
    return [Row(f"rrd, {len(logged)} rows", "rrd", "rerun's Python SDK", work)]
