from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dslam_mav.errors import BadInputError
from dslam_mav.log.recorder import Recorder
from dslam_mav.observations import Reading
from sim_bridge.fields.recorded import LoggedField, read_csv, read_series

FLIGHTS = Path(__file__).parents[4] / "shared" / "data" / "flights"
recorded = pytest.mark.skipif(not FLIGHTS.is_dir(), reason="needs the recorded flights in ../shared/data")


def csv_of(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_csv_with_the_contracts_columns(tmp_path: Path) -> None:
    series = read_series(csv_of(tmp_path, "time_s,value\n10,1\n\n12.5,3\n13,2\n"))
    np.testing.assert_array_equal(series.time_s, [10.0, 12.5, 13.0])
    np.testing.assert_array_equal(series.value, [1.0, 3.0, 2.0])
    assert series.place_m is None
    assert series.duration_s == 3.0


def test_csv_places_order_of_columns_and_byte_order_mark_do_not_matter(tmp_path: Path) -> None:
    series = read_csv(csv_of(tmp_path, "\ufeffnorth_m, value ,time_s,east_m\n2,7,0,1\n4,8,1,3\n"))
    assert series.place_m is not None
    np.testing.assert_array_equal(series.place_m, [[1.0, 2.0], [3.0, 4.0]])
    np.testing.assert_array_equal(series.value, [7.0, 8.0])


def test_csv_columns_of_other_names_and_units(tmp_path: Path) -> None:
    path = csv_of(tmp_path, "t ms,gas,X,Y\n0,100,1,2\n500,90,3,4\n")
    series = read_csv(path, "time_s=t ms*0.001, value=gas*-0.1,east_m=X,north_m=Y")
    np.testing.assert_allclose(series.time_s, [0.0, 0.5])
    np.testing.assert_allclose(series.value, [-10.0, -9.0])
    np.testing.assert_allclose(series.place_m, [[1.0, 2.0], [3.0, 4.0]])


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_columns_stand_apart_by_what_spreadsheets_write(delimiter: str, tmp_path: Path) -> None:
    text = "time_s,value,east_m,north_m\n0,1.5,1,2\n1,2.5,3,4\n".replace(",", delimiter)
    series = read_csv(csv_of(tmp_path, text))
    np.testing.assert_allclose(series.value, [1.5, 2.5])
    np.testing.assert_allclose(series.place_m, [[1.0, 2.0], [3.0, 4.0]])


@pytest.mark.parametrize(
    ("text", "columns", "said"),
    [
        ("", None, "is empty; expected a line of column names and readings below it"),
        (" \n\n", None, "is empty; expected a line of column names and readings below it"),
        (
            "time_s,reading\n0,1\n",
            None,
            "line 1: column value: missing, it has time_s, reading; --columns value=NAME says which it is",
        ),
        ("time_s,value\n0,1\n1,2\n", "east_m=X", "line 1: column X: missing, it has time_s, value"),
        ("time_s,value\n0,1\n1,warm\n", None, "line 3: value: expected a finite number, got 'warm'"),
        ("time_s,value\n0,1\n1,nan\n", None, "line 3: value: expected a finite number, got 'nan'"),
        ("time_s,value\n0,1\n1\n", None, "line 3: value: expected a finite number, got ''"),
        (
            "time_s,value\n0,1\n5,1\n5,2\n",
            None,
            "line 4: time_s: expected later than the line before, got 5 s",
        ),
        ("time_s,value\n0,1\n", None, "expected at least 2 lines of readings, got 1"),
    ],
)
def test_a_wrong_csv_is_told_by_file_line_column_and_value(
    text: str, columns: str | None, said: str, tmp_path: Path
) -> None:
    path = csv_of(tmp_path, text)
    with pytest.raises(BadInputError) as caught:
        read_csv(path, columns)
    assert str(caught.value) == f"{path}: {said}"


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ("value", "--columns: value: expected FIELD=NAME with FIELD of time_s, value, east_m, north_m"),
        ("speed=V", "--columns: speed=V: expected FIELD=NAME with FIELD of time_s, value, east_m, north_m"),
        ("value=V*x", "--columns: value=V*x: expected a number other than 0 after *, got 'x'"),
        ("value=V*0", "--columns: value=V*0: expected a number other than 0 after *, got '0'"),
    ],
)
def test_wrong_columns_are_told(columns: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(BadInputError) as caught:
        read_csv(csv_of(tmp_path, "time_s,value\n0,1\n1,2\n"), columns)
    assert str(caught.value) == said


def test_files_that_are_no_log_are_told(tmp_path: Path) -> None:
    (tmp_path / "bytes.csv").write_bytes(b"\xff\xfe\x00")
    for name, said in [
        ("none.csv", "cannot be read"),
        ("bytes.csv", "expected text"),
        ("a.xyz", "expected a .csv"),
    ]:
        with pytest.raises(BadInputError, match=f"{name}: {said}"):
            read_series(tmp_path / name)


def test_a_logged_field_replays_by_time_and_has_nothing_after_its_end(tmp_path: Path) -> None:
    field = LoggedField(read_csv(csv_of(tmp_path, "time_s,value\n100,1\n102,3\n103,0\n")))
    read = field.read(np.array([0.0, 1.0, 2.0, 2.5, 3.0, 3.1]), np.full((6, 3), 1e6))
    np.testing.assert_allclose(read, [1.0, 2.0, 3.0, 1.5, 0.0, np.nan])
    assert field.duration_s == 3.0


def test_readings_of_a_flight_log(tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    with Recorder(path) as recorder:
        for i in range(5):
            recorder.reading(10**18 + i, Reading(1000 + 20 * i, 20.0 + i))
            recorder.reading(10**18 + i, Reading(1000 + 20 * i, -1.0, "THERMAL2"))
    series = read_series(path)
    np.testing.assert_allclose(series.time_s, 1.0 + 0.02 * np.arange(5))
    np.testing.assert_allclose(series.value, 20.0 + np.arange(5))
    assert set(read_series(path, "value=THERMAL2").value) == {-1.0}
    with pytest.raises(BadInputError, match="value THERMAL3: not in this log, it has THERMAL, THERMAL2"):
        read_series(path, "value=THERMAL3")


@recorded
@pytest.mark.parametrize(
    ("choice", "count", "lowest", "highest"),
    [
        ("NAMED_VALUE_FLOAT.PilotGain", 500, 0.0, 1.0),
        ("NAMED_VALUE_FLOAT.CamTilt", 500, -1e3, 1e3),
        ("NAMED_VALUE_FLOAT.TetherTrn", 500, -10.0, 10.0),
        ("SCALED_PRESSURE2.temperature*0.01", 600, 0.0, 40.0),  # water, °C
        ("SCALED_PRESSURE.temperature*0.01", 500, 0.0, 80.0),
        ("VFR_HUD.heading@1/1", 2500, 0.0, 360.0),  # no time of its own: the log's
    ],
)
def test_a_real_dive_gives_any_named_value(choice: str, count: int, lowest: float, highest: float) -> None:
    series = read_series(FLIGHTS / "ardusub_dive.tlog", f"value={choice}")
    assert len(series.value) + series.dropped >= count
    assert series.dropped < 0.2 * count
    assert lowest <= series.value.min() <= series.value.max() <= highest
    assert 100.0 < series.duration_s < 1000.0


@recorded
def test_a_tlog_without_the_value_says_what_it_has() -> None:
    dive = FLIGHTS / "ardusub_dive.tlog"
    with pytest.raises(
        BadInputError, match=r"NAMED_VALUE_FLOAT\.THERMAL: not in this log, it has NAMED_VALUE_FLOAT.CamPan"
    ):
        read_series(dive)
    with pytest.raises(BadInputError, match=r"SCALED_PRESSURE2.heat: not in .*SCALED_PRESSURE2.temperature"):
        read_series(dive, "value=SCALED_PRESSURE2.heat")
    with pytest.raises(BadInputError, match=r"HEARTBEAT\.type: several senders, choose with @ one of 1/1, "):
        read_series(dive, "value=HEARTBEAT.type")
    with pytest.raises(BadInputError, match="expected MESSAGE"):
        read_series(dive, "value=depth")
    with pytest.raises(BadInputError, match=r"time_s: .* has times of its own"):
        read_series(dive, "time_s=x")


@recorded
def test_the_readings_of_a_real_copters_flight() -> None:
    series = read_series(FLIGHTS / "copter_flow_k2_static.tlog")
    assert len(series.value) > 2500
    assert np.median(np.diff(series.time_s)) == pytest.approx(0.05, abs=0.01)  # 20 readings a second
    assert 19.0 < series.value.min() < 21.0  # the ambient, 20


@recorded
def test_a_gas_sensors_flight_with_its_places() -> None:
    series = read_csv(FLIGHTS / "nano_drone_gas_A_1.csv", "time_s=Time*0.001,value=Gas1L*-1,east_m=X,north_m=Y")
    assert series.place_m is not None
    assert np.diff(series.time_s).mean() == pytest.approx(0.1, rel=0.1)
    assert series.value[0] == -18996.0
    np.testing.assert_allclose(series.place_m[0], [0.0515726432, 0.1436368376])
