"""A log is read with nothing but the file: no schema of ours, none of Foxglove's, only MCAP and protobuf."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from dslam_mav.log import read_log
from dslam_mav.log.recover import salvage

READER = """
import json, sys
from google.protobuf import descriptor_pb2, descriptor_pool, json_format, message_factory, unknown_fields
from mcap.reader import make_reader

def message_class(schema):
    described = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
    pool, waiting, known = descriptor_pool.DescriptorPool(), list(described.file), set()
    while waiting:
        ready = [file for file in waiting if set(file.dependency) <= known]
        assert ready, f"{schema.name}: needs what the file has not"
        for file in ready:
            pool.Add(file)
            known.add(file.name)
            waiting.remove(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))

classes, found = {}, {}
with open(sys.argv[1], "rb") as file:
    for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages(log_time_order=False):
        assert (schema.encoding, channel.message_encoding) == ("protobuf", "protobuf")
        if schema.id not in classes:
            classes[schema.id] = message_class(schema)
        value = classes[schema.id].FromString(message.data)
        assert not len(unknown_fields.UnknownFieldSet(value)), channel.topic
        seen = found.setdefault(channel.topic, {"schema": schema.name, "count": 0})
        seen["count"] += 1
        if seen["count"] == 1:
            seen["first"] = json_format.MessageToDict(value, preserving_proto_field_name=True)
assert not {"dslam_mav", "foxglove_schemas_protobuf", "mcap_protobuf"} & set(sys.modules)
print(json.dumps(found))
"""


@pytest.mark.parametrize("recovered", [False, True])
def test_a_log_tells_all_with_nothing_but_the_file(flight: Path, tmp_path: Path, recovered: bool) -> None:
    path = flight
    if recovered:  # also where the chunk with the schemas is lost, and they are ours again
        path, data = tmp_path / "out.mcap", bytearray(flight.read_bytes())
        data[400] ^= 1
        damaged = tmp_path / "damaged.mcap"
        damaged.write_bytes(data[: len(data) // 2])
        path.write_bytes(salvage(damaged).data)
    done = subprocess.run([sys.executable, "-c", READER, str(path)], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    found = json.loads(done.stdout)
    log = read_log(path)
    assert {topic: seen["count"] for topic, seen in found.items()} == log.topics
    assert found["/thermal"]["schema"] == "dslam_mav.ThermalReading"
    assert found["/thermal"]["first"]["value"] == log.readings[0][1].value
    estimate = found["/estimate"]["first"]["estimate"]
    assert estimate["verdict_name"] == "IDENTIFIED"
    vertices = log.estimates[0].estimate.path.vertices_m
    assert estimate["path"]["vertices_m"] == {"shape": list(vertices.shape), "values": vertices.ravel().tolist()}
    assert found["/path"]["schema"] == "foxglove.PosesInFrame"
    poses = [[pose["position"].get(axis, 0.0) for axis in "xy"] for pose in found["/path"]["first"]["poses"]]
    assert poses == vertices[:, :2].tolist()
    assert found["/scene"]["schema"] == "foxglove.SceneUpdate"
    assert found["/log"]["first"]["message"] == log.texts[0][2]
