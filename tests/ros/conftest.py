import importlib.util

import pytest

NEEDED = ("rclpy", "nav_msgs", "diagnostic_msgs", "std_srvs", "cyclonedds")
missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if missing:
        skip = pytest.mark.skip(reason='needs real ROS 2 middleware: pip install "mapmeld[ros]"')
        for item in items:
            if item.get_closest_marker("ros"):
                item.add_marker(skip)
