"""``ros2 run mapmeld_ros mapmeld``: the node of mapmeld on the rclpy of this ROS installation."""

import sys

from mapmeld.errors import MapmeldError
from mapmeld.ros.node import run


def main() -> None:
    """Run it; what a user can mend is one line."""
    try:
        run(ros_arguments=sys.argv[1:])
    except MapmeldError as error:
        sys.exit(f"mapmeld: {error}")


if __name__ == "__main__":
    main()
