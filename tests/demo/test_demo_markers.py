"""Tests that the demo's markers are at the positions of its world."""

import msgspec

from arcor2_fakes.cell.layout import Layout
from arcor2_hw.calibration.configuration import read_configuration
from arcor2_server.demo.workplace import layout_file, markers_file


def test_server_and_simulated_cell_have_the_same_markers() -> None:
    camera = msgspec.json.decode(layout_file().read_bytes(), type=Layout).camera
    assert camera is not None
    configuration = read_configuration(markers_file())
    assert {(one.marker_id, tuple(one.pose.position), configuration.marker_size) for one in configuration.markers} == {
        (one.id, one.pose.position, one.size) for one in camera.markers
    }
    assert all(one.pose.orientation == (0.0, 0.0, 0.0, 1.0) for one in camera.markers)
    assert len(configuration.markers) >= 3
