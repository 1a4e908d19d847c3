"""ros2 launch mapmeld_ros mapmeld.launch.py [params_file:=...] [robots:="['r1','r2']"] [rviz:=true]."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """Return the node, and rviz if asked for."""
    share = FindPackageShare("mapmeld_ros")
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "params_file", default_value=PathJoinSubstitution([share, "config", "mapmeld.yaml"])
            ),
            DeclareLaunchArgument("use_sim_time", default_value="false"),
            DeclareLaunchArgument("robots", default_value="['auto']"),
            DeclareLaunchArgument("rviz", default_value="false"),
            Node(
                package="mapmeld_ros",
                executable="mapmeld",
                name="mapmeld",
                output="screen",
                parameters=[
                    LaunchConfiguration("params_file"),
                    {
                        "use_sim_time": LaunchConfiguration("use_sim_time"),
                        "robots": LaunchConfiguration("robots"),
                    },
                ],
            ),
            Node(
                package="rviz2",
                executable="rviz2",
                arguments=["-d", PathJoinSubstitution([share, "rviz", "mapmeld.rviz"])],
                condition=IfCondition(LaunchConfiguration("rviz")),
            ),
        ]
    )
