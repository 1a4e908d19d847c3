"""The node of mapmeld as a package of ROS 2. mapmeld itself comes by pip: pip install mapmeld."""

from glob import glob

from setuptools import setup

NAME = "mapmeld_ros"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", glob("launch/*.launch.py")),
        (f"share/{NAME}/config", glob("config/*.yaml")),
        (f"share/{NAME}/rviz", glob("rviz/*.rviz")),
        (f"share/{NAME}/foxglove", glob("foxglove/*.json")),
    ],
    install_requires=["setuptools", "mapmeld"],
    zip_safe=True,
    maintainer="The mapmeld authors",
    maintainer_email="mapmeld@users.noreply.github.com",
    description="Merges the maps of robots that explore, while they explore.",
    license="Apache-2.0",
    entry_points={"console_scripts": [f"mapmeld = {NAME}.node:main"]},
)
