"""The search for the net's orientation."""

import math
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from shellform.errors import InputError
from shellform.net.chebyshev import NetSettings
from shellform.net.orientation import best_orientation, oriented_net
from tests.net.test_closed_forms import roof
from tests.net.test_settings import ball


@pytest.fixture(scope="module")
def cylinder():
    return roof(1.0, 0.8, 2.0, n=20)


def test_on_a_cylinder_rods_bend_least_at_45_degrees(cylinder):
    """At the angle a the mean of the squared curvatures is (cos⁴ a + sin⁴ a) / 2, smallest at 45°."""
    said = []
    best, tried = best_orientation(cylinder, NetSettings(spacing=0.25, gap=0.005), progress=said.append)
    # A cut-out of so few rods isn't quite even: one step of the search, 7.5°, is allowed.
    assert math.degrees(best.angle) == pytest.approx(45.0, abs=7.501)
    assert best.cost == min(trial.cost for trial in tried)
    rolled = 0.5 * 0.25 * 0.25**2  # κ² = 1/4, of the flat grid rolled up; at 0° it would be twice as much
    assert 0.7 * rolled < best.cost < rolled  # pulled, it gives way in shear to bend still less
    assert any("compass net 12/12" in line for line in said)


def test_two_processes_find_what_one_finds(cylinder):
    settings = NetSettings(spacing=0.4, gap=0.005)
    net, angle, offset = oriented_net(cylinder, settings, angle="auto", workers=2)
    best, _ = best_orientation(cylinder, settings)
    assert (angle, offset) == (best.angle, best.offset)
    assert net.quality.distance_max < 0.01


def test_a_given_angle_is_kept(cylinder):
    _, angle, offset = oriented_net(
        cylinder, NetSettings(spacing=0.4, gap=0.005), angle=0.2, offset=(0.5, 0.0)
    )
    assert (angle, offset) == (0.2, (0.5, 0.0))


def test_where_no_angle_gives_a_net_it_is_said_why():
    with pytest.raises(
        InputError, match=r"no angle gives a net: .*curved too much.*\. Choose a smaller spacing\.$"
    ):
        best_orientation(ball(30), NetSettings(spacing=0.3, gap=0.005))


def test_an_offset_that_lies_off_the_surface_at_every_angle_is_told_to_be_smaller(cylinder):
    with pytest.raises(
        InputError, match=r"no angle gives a net: .* off the surface.*Choose a smaller offset"
    ):
        best_orientation(cylinder, NetSettings(spacing=0.25, gap=0.005), offset=(40.0, 0.0))


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            {"gap": 0.2},
            r"^joint\.gap: must be positive and well below the spacing \(found 0\.2\)\. Give metres",
        ),
        ({"spring_density": [5.0, 0.5]}, r"^net\.spring_density: must be .*found \[5\.0, 0\.5\]\)\. For"),
        ({"outline": [[0.0, 0.0, 1.0]]}, r"^net\.outline has the wrong shape"),
    ],
)
def test_what_no_angle_helps_is_refused_as_it_is(given, said, workers):
    settings = NetSettings(**{"spacing": 0.3, "gap": 0.005, **given})
    with pytest.raises(InputError, match=said):
        best_orientation(ball(30), settings, workers=workers)


@pytest.mark.skipif(sys.platform != "linux", reason="where no other system ends them with their run")
def test_processes_that_try_nets_end_with_the_one_that_is_killed():
    """They waited for work for ever."""
    code = (
        "import multiprocessing, os, signal\n"
        "from shellform.net.chebyshev import NetSettings\n"
        "from shellform.net.orientation import best_orientation\n"
        "from tests.net.test_closed_forms import roof\n"
        "def told(text):\n"
        "    print(*(each.pid for each in multiprocessing.active_children()), flush=True)\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
        "if __name__ == '__main__':\n"
        "    settings = NetSettings(spacing=0.25, gap=0.005)\n"
        "    best_orientation(roof(1.0, 0.8, 2.0, n=20), settings, workers=2, progress=told)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr
    workers = [Path("/proc", number) for number in done.stdout.split()]
    assert workers
    end = time.monotonic() + 10.0
    while any(each.exists() and "Z" not in (each / "stat").read_text().rsplit(")", 1)[1] for each in workers):
        assert time.monotonic() < end
        time.sleep(0.05)
