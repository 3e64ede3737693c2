"""Foxglove and Rerun know our pictures by exact names, and the file explains itself."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from dslam_mav.dslam.field import field
from dslam_mav.log import Recorder, log_info
from dslam_mav.log.pictures import pictures

SCHEMAS = {
    "/mavlink/raw": "dslam_mav.RawFrame",
    "/thermal": "dslam_mav.ThermalReading",
    "/mission": "dslam_mav.MissionProgress",
    "/estimate": "dslam_mav.EstimateUpdate",
    "/log": "foxglove.Log",
    "/truth": "dslam_mav.Truth",
    "/path": "foxglove.PosesInFrame",
    "/scene": "foxglove.SceneUpdate",
    "/field": "foxglove.Grid",
    "/field_points": "foxglove.PointCloud",
    "/prediction": "dslam_mav.Prediction",
    "/path_points": "foxglove.PointCloud",
    "/source_points": "foxglove.PointCloud",
    "/reading_points": "foxglove.PointCloud",
}


def decoded(path):
    """Every message by the library alone, with the descriptors in the file."""
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return [(s, c, m, d) for s, c, m, d in reader.iter_decoded_messages()]


def dots(cloud):
    """(N, 4) x, y, z and value of a cloud's points; a fifth column packs their colours."""
    assert [(f.name, f.offset) for f in cloud.fields][:5] == [("x", 0), ("y", 4), ("z", 8), ("value", 12), ("red", 16)]
    return np.frombuffer(cloud.data, dtype="<f4").reshape(-1, cloud.point_stride // 4)


def test_the_file_decodes_with_its_own_descriptors(flight):
    seen = {}
    for schema, channel, message, value in decoded(flight):
        assert channel.message_encoding == schema.encoding == "protobuf"
        assert value.DESCRIPTOR.full_name == schema.name
        assert message.log_time == message.publish_time > 1_700_000_000_000_000_000
        seen[channel.topic] = schema.name
    assert seen == SCHEMAS
    with flight.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert {c.topic: c.id for c in reader.get_summary().channels.values()} == {
            topic: number for number, topic in enumerate(SCHEMAS, start=1)
        }  # old logs whose first chunk is lost are read by these numbers: they never change
        assert reader.get_summary().statistics.message_count == sum(log_info(flight)["topics"].values())
        assert next(a.name for a in reader.iter_attachments()) == "plan.plan"


def test_messages_say_what_the_estimate_says(flight, estimate):
    by_topic = {}
    for _, channel, message, value in decoded(flight):
        by_topic.setdefault(channel.topic, (message, value))
    expected = estimate(0)
    update = by_topic["/estimate"][1]
    assert update.estimate.verdict_name == "IDENTIFIED"
    assert list(update.estimate.sources.position_m.values) == expected.sources.position_m.ravel().tolist()
    message, line = by_topic["/log"]
    assert line.level == 3
    assert line.timestamp.seconds * 10**9 + line.timestamp.nanos == message.log_time
    path = by_topic["/path"][1]
    assert path.frame_id == "canonical"
    places = [(p.position.x, p.position.y) for p in path.poses]
    assert places == [tuple(v) for v in expected.path.vertices_m.tolist()]
    heading = expected.path.heading_rad[0]
    assert path.poses[0].orientation.z == pytest.approx(np.sin(heading / 2))


def test_the_scene_shows_sources_with_their_uncertainty(estimate):
    before = estimate(alternatives=(estimate(5),))
    scene = dict(pictures(5, before))["/scene"]
    entities = {entity.id: entity for entity in scene.entities}
    sources = entities["sources"]
    assert len(sources.spheres) == len(sources.lines) == len(sources.texts) == 3
    assert f"{before.sources.peak_reading[0]:.3g}" in sources.texts[0].text
    ring = np.array([(p.x, p.y) for p in sources.lines[1].points]) - before.sources.position_m[1]
    mahalanobis2 = np.einsum("ni,ij,nj->n", ring, np.linalg.inv(before.position_covariance_m2[1]), ring)
    np.testing.assert_allclose(mahalanobis2, 5.991, rtol=1e-3)  # 95 % of χ² with 2 degrees of freedom
    assert len(entities["path"].lines[0].points) == 6
    assert len(entities["alternatives"].spheres) == 3


def test_the_field_is_the_reconstructed_one(estimate):
    before = estimate()
    drawn = dict(pictures(5, before))
    grid, cloud = drawn["/field"], drawn["/field_points"]
    points = dots(cloud)
    assert len(points) == 64 * 64
    spread2 = before.spread_m**2
    expected = field(points[:, :2], spread2, before.sources.position_m, before.sources.amplitude)
    np.testing.assert_allclose(points[:, 3], expected, atol=1e-4)
    cells = np.frombuffer(grid.data, dtype="<f4").reshape(64, grid.row_stride // 4)[:, :: grid.cell_stride // 4]
    np.testing.assert_array_equal(cells.ravel(), points[:, 3])
    x = grid.pose.position.x + grid.cell_size.x * (np.arange(64) + 0.5)
    np.testing.assert_allclose(points[:64, 0], x, rtol=1e-5, atol=1e-5)
    inside = (before.path.vertices_m >= [x[0] - grid.cell_size.x, grid.pose.position.y]).all()
    assert inside
    assert (len(grid.data), grid.column_count) == (64 * grid.row_stride, 64)


def test_path_and_sources_are_points_too_for_who_draws_no_scene(estimate):
    """Rerun draws no SceneUpdate and of PosesInFrame nothing that is seen."""
    before = estimate()
    drawn = dict(pictures(5, before))
    path, vertices = dots(drawn["/path_points"]), before.path.vertices_m
    flown = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(vertices, axis=0), axis=1))])
    np.testing.assert_allclose(path[[0, -1], :2], vertices[[0, -1]], atol=1e-5)
    np.testing.assert_allclose(path[:, 0], np.interp(path[:, 3], flown, vertices[:, 0]), atol=1e-4)
    sources = dots(drawn["/source_points"])
    for k in range(3):
        centre, *ring = sources[sources[:, 3] == k + 1, :2] - before.sources.position_m[k]
        np.testing.assert_allclose(centre, 0.0, atol=1e-6)
        precision = np.linalg.inv(before.position_covariance_m2[k])
        np.testing.assert_allclose(np.einsum("ni,ij,nj->n", ring, precision, ring), 5.991, rtol=1e-2)
    assert "/reading_points" not in drawn


@pytest.mark.parametrize("dimensions", [2, 3])
def test_readings_stand_above_where_they_were_taken(estimate, legs_flown, dimensions):
    before, flight = estimate(dimensions=dimensions), legs_flown()
    points = dots(dict(pictures(5, before, flight))["/reading_points"])
    reading = np.concatenate([leg.reading for leg in flight.legs])
    np.testing.assert_allclose(points[:, 3], reading, rtol=1e-6)
    vertices = before.path.vertices_m
    for leg, (begin, end) in enumerate(pairwise(vertices)):
        own = points[np.floor(points[:, 3]) == leg + 1, :2]
        across = np.array([-(end - begin)[1], (end - begin)[0]])
        off = (own - begin[:2]) @ across
        np.testing.assert_allclose(off, 0.0, atol=1e-4)
    if dimensions == 2:
        height = points[:, 2] / (points[:, 3] - reading.min() + 1e-12)
        np.testing.assert_allclose(height[1:], height[-1], rtol=1e-4)
    many = dots(dict(pictures(5, before, legs_flown(readings=5000)))["/reading_points"])
    assert 1000 < len(many) <= 2000
    assert "/reading_points" not in dict(pictures(5, before, legs_flown(legs=4)))


def test_positions_that_are_nan_draw_nothing(nan_estimate, tmp_path):
    drawn = list(pictures(5, nan_estimate()))
    assert drawn[0][0] == "/scene"
    assert not drawn[0][1].entities
    assert drawn[0][1].deletions[0].type == 1  # what was drawn before disappears
    assert {topic for topic, _ in drawn[1:]} == {"/path_points", "/source_points", "/field_points", "/reading_points"}
    assert not any(len(dots(cloud)) for _, cloud in drawn[1:])


@pytest.mark.parametrize("value", [np.nan, 0.0, -1.0])
def test_an_unknown_spread_draws_no_field(estimate, value):
    before = estimate()
    sources = type(before.sources)(
        before.sources.position_m, before.sources.amplitude, np.full(3, value), before.sources.activation_s
    )
    drawn = dict(pictures(5, estimate(sources=sources, position_covariance_m2=np.full((3, 2, 2), np.nan))))
    assert set(drawn) == {"/path", "/scene", "/path_points", "/source_points"}
    assert len(dots(drawn["/source_points"])) == 3, "the sources alone, no region"
    assert not next(e for e in drawn["/scene"].entities if e.id == "sources").lines


def test_space_is_drawn_too(estimate, tmp_path):
    before = estimate(dimensions=3)
    drawn = dict(pictures(5, before))
    assert drawn["/path"].poses[1].position.z == before.path.vertices_m[1, 2]
    assert len(next(e for e in drawn["/scene"].entities if e.id == "sources").lines) == 9
    assert drawn["/field"].pose.position.z == before.sources.position_m[0, 2]
    with Recorder(tmp_path / "flight.mcap") as recorder:
        recorder.estimate(5, before, 5, final=True)
    assert len(decoded(tmp_path / "flight.mcap")) == 7
