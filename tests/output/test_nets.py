"""Maps of net_maps."""

import matplotlib.image
import numpy as np
import pytest

from shellform.output.pictures import maps, net_maps


def test_a_net_is_mapped_by_distance_curvature_skewness_and_springs(net, tmp_path):
    files = net_maps.draw_net(net, tmp_path)
    assert [file.name for file in files] == [
        "net-distance.png",
        "net-curvature.png",
        "net-skew.png",
        "net-springs.png",
    ]
    pictures = [matplotlib.image.imread(file) for file in files]
    assert all(np.ptp(picture) > 0.5 for picture in pictures)
    assert not np.array_equal(pictures[0], pictures[1])


def test_values_at_crossings_are_carried_along_the_rods_and_kept_at_them(net):
    values = np.linspace(1.0, 2.0, len(net.grid.lattice))
    carried = maps.along_rods(net, values)
    np.testing.assert_array_equal(carried[net.grid.crossing_nodes[:, 0]], values)
    np.testing.assert_array_equal(carried[net.grid.crossing_nodes[:, 1]], values)
    assert 1.0 <= carried.min() <= carried.max() <= 2.0


def test_the_map_of_skew_shows_how_far_crossings_are_from_a_right_angle(net):
    shown = net_maps._values(net, "skew")
    skew = np.abs(0.5 * np.pi - net.quality.shear_angle)
    assert shown.max() == pytest.approx(skew.max())
    assert 0.0 < skew.max() < 0.25 * np.pi
