# SPDX-License-Identifier: Apache-2.0
"""Installs rover_planner, by pip or as an ament_python package by colcon."""

import re
from pathlib import Path

from setuptools import find_packages, setup

NAME = "rover_planner"
IMPORT_PACKAGES = ("rover_physics", "msg_adapters", "rover_planner")
HERE = Path(__file__).resolve().parent  # colcon --symlink-install runs a link to this file

# Lower bounds: what Ubuntu Noble has, the home of ROS 2 Jazzy; numba, osqp and clarabel are not in
# it, its pydantic is version 1, and its typer is 0.9, which knows no `float | None`. 0.18 is the
# first typer that works with every click it allows. constraints-lowest.txt holds the lowest
# versions; a test installs them.
# Upper bounds: the next version that may break. constraints.txt holds the versions tested.
REQUIRES = [
    "numpy>=1.26,<3",
    "scipy>=1.11,<2",
    "numba>=0.60,<1",
    "osqp>=1.0,<2",
    "clarabel>=0.10,<1",
    "pydantic>=2.12,<3",
    "PyYAML>=6.0,<7",
    "typer>=0.18,<1",
    "rich>=13.7,<16",
]
EXTRAS = {
    "ros": [
        "ros-jazzy-rclpy>=7.1,<8",
        "ros-jazzy-common-interfaces>=5.3,<6",
        "ros-jazzy-rmw-fastrtps-cpp>=8.4,<9",
    ],
    "plots": ["matplotlib>=3.6,<4"],
    "view": ["viser>=1.1.1,<1.2", "websockets>=14,<17", "trimesh>=4.0,<6", "matplotlib>=3.6,<4"],
    "bags": ["rosbags>=0.11,<1"],
    "survey": [
        "dask>=2024.8,<2027",
        "distributed>=2024.8,<2027",
        "zarr>=3.1.3,<4",  # writes files whole
        "rasterio>=1.4,<2",
        "matplotlib>=3.6,<4",
    ],
    "test": [
        "pytest>=7.4,<10",
        "pytest-xdist>=3.7,<4",
        "hypothesis>=6.98,<7",
        "playwright>=1.48,<2",
        "mujoco>=3.3,<5",
    ],
    "bench": ["mujoco>=3.3,<5"],
    "dev": [
        "ruff>=0.9,<1",
        "oxlint>=1.0,<2",
        "mypy>=1.14,<3",
        "uv>=0.5,<1",
    ],
    "coverage": ["pytest-cov>=6.0,<8"],
}
EXTRAS["all"] = [
    one for name in ("ros", "plots", "view", "bags", "survey", "test") for one in EXTRAS[name]
]


def read_version() -> str:
    """Return __version__ of rover_physics, the one place where the version is kept."""
    text = (HERE / "rover_physics" / "__init__.py").read_text(encoding="utf-8")
    match = re.search(r'^__version__ = "([^"]+)"$', text, re.MULTILINE)
    if match is None:
        raise RuntimeError("rover_physics/__init__.py has no __version__")
    return match.group(1)


def list_data_files() -> list[tuple[str, list[str]]]:
    """List what goes to share/: manifest, ament marker, configuration, examples, launch files."""
    share = f"share/{NAME}"
    folders = {share: ["package.xml"]}
    for top in ("config", "examples", "launch"):
        for path in sorted((HERE / top).rglob("*")):
            if path.is_file():
                relative = path.relative_to(HERE)
                folder = f"{share}/{relative.parent.as_posix()}"
                folders.setdefault(folder, []).append(relative.as_posix())
    folders["share/ament_index/resource_index/packages"] = [f"resource/{NAME}"]
    return list(folders.items())


setup(
    name=NAME,
    version=read_version(),
    packages=find_packages(HERE, include=[f"{name}*" for name in IMPORT_PACKAGES]),
    package_data={"rover_planner.viewer.front": ["page.html", "page.css", "page.js"]},
    data_files=list_data_files(),
    python_requires=">=3.11",
    install_requires=REQUIRES,
    extras_require=EXTRAS,
    zip_safe=False,
    author="rover_planner maintainers",
    description="Onboard action planning for rocker-bogie rovers on ROS 2",
    long_description=(HERE / "README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "rover_planner = rover_planner.__main__:main",
            "traverse_server = rover_planner.nodes.start:start_traverse_server",
            "traction_controller = rover_planner.nodes.start:start_traction_controller",
            "mission_planner = rover_planner.nodes.start:start_mission_planner",
            "rover_simulator = rover_planner.nodes.start:start_rover_simulator",
            "ground_learner = rover_planner.nodes.start:start_ground_learner",
        ],
    },
)
