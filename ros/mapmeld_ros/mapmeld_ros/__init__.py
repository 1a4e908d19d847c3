"""The node of mapmeld for ros2 run and ros2 launch."""
