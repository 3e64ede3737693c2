"""The Foxglove layout: it fits Foxglove's format, and everything it shows is in a log.

The format is what the app exports and imports: panels by id, an id being the panel's type and a name, and a tree of
splits over them. The panels' settings are checked against those that Foxglove's own package knows, where it is there.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from google.protobuf.descriptor import Descriptor
from running import run

from dslam_mav.log.topics import TOPICS
from dslam_mav.records import Verdict


@pytest.fixture(scope="module")
def layout() -> dict[str, Any]:
    done = run("layout")
    assert (done.code, done.err) == (0, "")
    return json.loads(done.out)


def leaves(tree: Any) -> Iterator[str]:
    if isinstance(tree, str):
        yield tree
        return
    assert set(tree) == {"direction", "first", "second", "splitPercentage"}
    assert tree["direction"] in ("row", "column")
    assert 0 < tree["splitPercentage"] < 100
    yield from leaves(tree["first"])
    yield from leaves(tree["second"])


def test_a_file_and_standard_output_are_the_same(layout: dict[str, Any], tmp_path: Path) -> None:
    file = tmp_path / "layout.json"
    done = run("layout", "-o", file, "--json")
    assert (done.code, done.object) == (0, {"layout": str(file)})
    assert json.loads(file.read_text()) == layout == run("layout", "--json").object
    nowhere = run("layout", "-o", tmp_path / "no" / "layout.json")
    assert (nowhere.code, nowhere.out) == (2, "")
    assert "no/layout.json: cannot be written" in nowhere.line()


def test_every_panel_is_placed_once(layout: dict[str, Any]) -> None:
    assert {"configById", "layout", "globalVariables", "userNodes", "playbackConfig"} == set(layout)
    placed = list(leaves(layout["layout"]))
    assert sorted(placed) == sorted(layout["configById"])
    kinds = {name.split("!")[0] for name in placed}
    assert kinds == {"3D", "Plot", "Indicator", "RosOut"}


def paths(layout: dict[str, Any]) -> list[str]:
    """Every message path a panel reads."""
    panels = layout["configById"].values()
    plotted = [path["value"] for panel in panels for path in panel.get("paths", ())]
    return [*plotted, *(panel["path"] for panel in panels if "path" in panel)]


def field_kind(descriptor: Descriptor, names: list[str]) -> str:
    """What a path leads to: a number or a text."""
    name, _, index = names[0].partition("[")
    field = descriptor.fields_by_name[name]
    assert field.is_repeated == bool(index)
    if field.message_type is not None:
        return field_kind(field.message_type, names[1:])
    assert len(names) == 1
    return "text" if field.type == field.TYPE_STRING else "number"


def test_every_path_leads_to_a_value_of_our_messages(layout: dict[str, Any]) -> None:
    found = paths(layout)
    assert any(path.startswith("/thermal") for path in found)
    assert any(path.startswith("/estimate") for path in found)
    for path in found:
        topic, *names = path.split(".")
        kind = field_kind(TOPICS[topic].DESCRIPTOR, names)
        assert kind == ("text" if path == layout["configById"]["Indicator!verdict"]["path"] else "number")


def test_topics_and_verdicts_are_ours(layout: dict[str, Any]) -> None:
    panels = layout["configById"]
    assert {"/path", "/scene", "/field"} <= set(panels["3D!map"]["topics"]) <= set(TOPICS)
    assert panels["RosOut!log"]["topicToRender"] == "/log"
    assert [rule["rawValue"] for rule in panels["Indicator!verdict"]["rules"]] == [verdict.name for verdict in Verdict]


def known(kind: Any) -> set[str]:
    """The settings that Foxglove's package writes for this kind of thing."""
    return set(kind()._to_dict())


def test_the_settings_are_those_foxglove_knows(layout: dict[str, Any]) -> None:
    fl = pytest.importorskip("foxglove.layouts", reason="foxglove-sdk is not installed")
    app = {"foxglovePanelTitle", "imageMode"}  # kept by the app around a panel's own settings
    panels = layout["configById"]
    configs = {"3D": fl.ThreeDeeConfig, "Plot": fl.PlotConfig, "Indicator": fl.IndicatorConfig, "RosOut": fl.LogConfig}
    for name, panel in panels.items():
        assert set(panel) - app <= known(configs[name.split("!")[0]]), name
    drawing = panels["3D!map"]
    assert set(drawing["cameraState"]) <= known(fl.ThreeDeeCameraState)
    assert set(drawing["topics"]["/path"]) <= known(fl.BaseRendererPosesTopicSettings)
    assert set(drawing["topics"]["/scene"]) <= known(fl.BaseRendererSceneUpdateTopicSettings)
    assert set(drawing["topics"]["/field"]) <= known(fl.BaseRendererGridTopicSettings)
    assert set(drawing["topics"]["/field_points"]) <= known(fl.BaseRendererPointCloudTopicSettings)
    assert set(drawing["layers"]["grid"]) - {"frameLocked"} <= known(fl.BaseRendererGridLayerSettings)
    for name in ("Plot!readings", "Plot!estimate"):
        for path in panels[name]["paths"]:
            assert set(path) <= known(fl.PlotSeries)
    for rule in panels["Indicator!verdict"]["rules"]:
        assert set(rule) <= known(fl.IndicatorRule)
