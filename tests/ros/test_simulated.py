"""Simulated robots on real middleware: the simulator, the node and who listens are processes of their own."""

import importlib.util
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from live_system import environment

NEEDED = ("rclpy", "nav_msgs", "diagnostic_msgs", "std_srvs", "cyclonedds", "mujoco", "numba")
missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(
        bool(missing), reason='needs ROS 2 middleware and a simulator: pip install "mapmeld[ros,sim]"'
    ),
]

# Four rooms of which no two are alike, around a corridor.
MAP = """\
8:1:1:1:4:1:1:1:7
0:-2:-2:-2:0:-2:-2:-2:0
0:-2:-2:-2:-1:-2:-2:-2:0
0:-2:-2:-2:0:-2:-2:-2:0
9:1:1:1:5:1:1:1:6
"""


@contextmanager
def simulated(domain: int, folder: Path, *options: str) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "mapmeld", "simulate", "--ros", *options]
    log = folder / "simulated.log"
    with log.open("w") as file:
        process = subprocess.Popen(
            command, env=environment(domain), stdout=file, stderr=file, cwd=folder, text=True
        )
    try:
        yield process
    except BaseException:
        print(log.read_text(), file=sys.stderr)
        raise
    finally:
        process.terminate()
        assert process.wait(timeout=20) == 0, log.read_text()
    assert "Traceback" not in log.read_text()
