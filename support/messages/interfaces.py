# SPDX-License-Identifier: Apache-2.0
"""Builds a package of messages that PyPI lacks, with the ROS generators that it has and gcc."""

import contextlib
import importlib
import importlib.util
import inspect
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rover_planner.ros.bags.bag_reader import GRID_MAP_FIELDS, GRID_MAP_INFO_FIELDS

GRID_MAP_MSGS = {"GridMapInfo": GRID_MAP_INFO_FIELDS, "GridMap": GRID_MAP_FIELDS}
"""Fields of the messages of grid_map_msgs for ROS 2, by name, those without others first."""
TF2_MSGS = {"TFMessage": "geometry_msgs/TransformStamped[] transforms"}
"""Fields of the message of /tf."""
USES = ("std_msgs", "geometry_msgs", "builtin_interfaces")
"""Packages whose messages occur in these."""
TYPE_SUPPORTS = ("rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c")
PREFIX = Path(sys.prefix)


@contextlib.contextmanager
def importable(package: str, messages: dict[str, str], folder: Path) -> Iterator[Any]:
    """Make the messages of a package importable, built in a folder where it is not installed.

    Yields:
        The module PACKAGE.msg.
    """
    if importlib.util.find_spec(package) is not None:
        yield importlib.import_module(f"{package}.msg")
        return
    build_messages(folder, package, messages, USES)
    sys.path.insert(0, str(folder))
    importlib.invalidate_caches()
    yield importlib.import_module(f"{package}.msg")
    sys.path.remove(str(folder))
    for name in [name for name in sys.modules if name.partition(".")[0] == package]:
        del sys.modules[name]


def build_messages(folder: Path, package: str, messages: dict[str, str], uses: Sequence[str]):
    """Build a package of messages below a folder; put the folder on sys.path to import it.

    Skips the test where the generators or the compiler are missing.

    Args:
        folder: An empty folder.
        package: Name of the package.
        messages: Fields of the messages by name.
        uses: Packages whose messages occur in the fields.
    """
    pytest.importorskip("rosidl_generator_py")
    if not (shutil.which("gcc") and shutil.which("g++")):
        pytest.skip("gcc and g++ are needed to build a package of messages")
    _generate(folder, package, messages)
    _compile(folder, package, uses)


def _generate(folder: Path, package: str, messages: dict[str, str]) -> None:
    from rosidl_adapter.msg import convert_msg_to_idl
    from rosidl_generator_c.cli import GenerateC
    from rosidl_generator_py.cli import GeneratePython
    from rosidl_generator_type_description.cli import HashTypeDescription
    from rosidl_typesupport_c.cli import GenerateCTypesupport
    from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport
    from rosidl_typesupport_introspection_c.cli import GenerateIntrospectionCTypesupport

    os.environ.setdefault("AMENT_PREFIX_PATH", str(PREFIX))
    sources = folder / "sources"
    (sources / "msg").mkdir(parents=True)
    files = []
    for name, fields in messages.items():
        (sources / "msg" / f"{name}.msg").write_text(inspect.cleandoc(fields))
        convert_msg_to_idl(sources, package, Path("msg") / f"{name}.msg", sources / "msg")
        files.append(f"{sources}:msg/{name}.idl")
    include = [str(PREFIX / "share")]
    hashes = HashTypeDescription("hash").generate_type_hashes(package, files, include, sources)
    own = [str(path) for path in hashes]
    GenerateC("c").generate(package, files, include, folder / "c" / package, own)
    for name, generator in (
        ("fastrtps", GenerateFastRTPSCTypesupport("fastrtps")),
        ("introspection", GenerateIntrospectionCTypesupport("introspection")),
        ("dispatch", GenerateCTypesupport("c", typesupport_implementations=TYPE_SUPPORTS)),
    ):
        generator.generate(package, files, include, folder / name / package)
    python = GeneratePython("py", typesupport_implementations=["rosidl_typesupport_c"])
    python.generate(package, files, include, folder / package)
    (folder / package / "__init__.py").touch()


def _compile(folder: Path, package: str, uses: Sequence[str]) -> None:
    """Compile the generated sources; all libraries are next to each other."""
    base = f"{package}__rosidl_"
    for part, kind in (
        ("c", "generator_c"),
        ("fastrtps", "typesupport_fastrtps_c"),
        ("introspection", "typesupport_introspection_c"),
        ("dispatch", "typesupport_c"),
    ):
        own = () if part == "c" else (f"{base}generator_c",)
        others = [f"{other}__rosidl_{kind}" for other in uses]
        if part == "dispatch":
            others = [f"{package}__{support}" for support in TYPE_SUPPORTS]
        runtime = "rosidl_runtime_c" if part == "c" else f"rosidl_{kind}"
        more = ("rosidl_typesupport_fastrtps_cpp", "fastcdr") if part == "fastrtps" else ()
        below = folder / part / package / "msg"
        sources = [*below.rglob("*.c"), *below.rglob("*.cpp")]
        _link(folder, sources, f"lib{base}{kind}.so", (*own, *others, runtime, *more))
    own = [f"{base}generator_c", f"{base}typesupport_c"]
    python = folder / package
    helpers = [f"{other}__rosidl_generator_py" for other in uses]
    sources = [*python.glob("msg/_*_s.c"), *python.glob("_*_s.ep.*.c")]
    module = f"{package}_s__rosidl_typesupport_c.so"
    _link(folder, sources, module, (*own, *helpers, "rosidl_typesupport_c"))
    shutil.move(folder / module, python / module)


def _link(folder: Path, sources: Iterable[Path], name: str, libraries: Sequence[str]) -> None:
    places = [folder / part for part in ("c", "fastrtps", "introspection", "dispatch")]
    include = PREFIX / "include"
    places += [include, *(path for path in include.iterdir() if path.is_dir())]
    places += [Path(sysconfig.get_paths()["include"]), Path(np.get_include())]
    paths = [str(path) for path in sources]
    compiler = "g++" if any(path.endswith(".cpp") for path in paths) else "gcc"
    # The soname lets the dispatcher find a library that is loaded already, by its name.
    words = [compiler, "-shared", "-fPIC", "-O0", "-o", str(folder / name), "-Wl,--no-as-needed"]
    words += [f"-Wl,-soname,{name}", f"-Wl,-rpath,{folder}", f"-L{folder}", f"-L{PREFIX}/lib"]
    words += [*paths, *(f"-I{path}" for path in places), *(f"-l{one}" for one in libraries)]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
