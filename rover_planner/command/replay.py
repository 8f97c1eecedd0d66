# SPDX-License-Identifier: Apache-2.0
"""The command `rover_planner replay`: answers the questions of a recorded drive again."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rover_planner.command.shared import argument, option
from rover_planner.errors import PlanningError
from rover_planner.shell.extras import need
from rover_planner.shell.poses import Pose, pose_option

if TYPE_CHECKING:
    from rover_planner.parameters.traverse_server import TraverseServerParameters
    from rover_planner.ros.bags.bag_files import BagWriter
    from rover_planner.ros.bags.replay import Replay, ReplayAnswer

NODE_KEYS = ("/**", "traverse_server", "/traverse_server")
"""Keys of a parameter file that are about traverse_server; later ones take precedence."""


def replay(
    bag: Annotated[Path, argument("BAG", "Folder of a rosbag2, or its .mcap or .db3 file.")],
    out: Annotated[Path, argument("OUT", "Folder for the answers; must not exist.")],
    parameters: Annotated[
        Path | None, option("FILE", "Parameter file of traverse_server, .yaml.")
    ] = None,
    rover: Annotated[str, option("ROVER", "Preset name or rover file; sets the parameter.")] = "",
    map_frame: Annotated[str, option("NAME", "Frame of the map; sets the parameter.")] = "",
    resolution: Annotated[float, option("M", "Cell size of the map; sets map_resolution.")] = 0.0,
    goal: Annotated[Pose | None, pose_option("Ask for a path to it after each new map.")] = None,
    start: Annotated[
        Pose | None, pose_option("Start of that path; default: the odometry.")
    ] = None,
    stretch: Annotated[float, option("M", "Length in which the drive is judged.", min=0.1)] = 5.0,
    map_topic: Annotated[str, option("TOPIC", "PointCloud2 or GridMap.")] = "",
    joints_topic: Annotated[str, option("TOPIC", "JointState.")] = "",
    odometry_topic: Annotated[str, option("TOPIC", "Odometry.")] = "",
    imu_topic: Annotated[str, option("TOPIC", "Imu, for the parameter imu_attitude.")] = "",
    path_topic: Annotated[str, option("TOPIC", "Path to check.")] = "",
) -> None:
    """Answer the questions of a bag again and write the predictions as MCAP and .npz.

    Questions are: the recorded drive, recorded paths, and a goal. Exit code 0: it ran, with any
    answer. 2: bad input.
    """
    need("rclpy", "replay")
    need("rosbags", "replay")
    from rover_planner.ros.bags import bag_files
    from rover_planner.ros.bags.replay import Replay
    from rover_planner.shell.progress import show_bar

    if start is not None and goal is None:
        raise PlanningError("--start is that of a path to --goal, which is not given")
    if out.exists():
        raise PlanningError(f"{out} exists already; OUT must be a new folder")
    given = {"rover": rover, "map_frame": map_frame, "map_resolution": resolution}
    work = Replay(_read_parameters(parameters, given), goal, start, stretch)
    topics = {
        bag_files.MAP: map_topic,
        bag_files.JOINTS: joints_topic,
        bag_files.ODOMETRY: odometry_topic,
        bag_files.IMU: imu_topic,
        bag_files.PATH: path_topic,
    }
    with bag_files.open_bag(bag, topics) as source:
        if bag_files.MAP not in source.topics:
            raise PlanningError(f"{bag}: has no map: PointCloud2 or GridMap")
        try:
            out.mkdir(parents=True)
        except OSError as error:
            raise PlanningError(f"{out} cannot be made: {error.strerror or error}") from None
        with (
            bag_files.write_bag(out / "predictions") as predictions,
            show_bar("replay", source.count) as step,
        ):
            results = _Results(out, work, predictions)
            for recorded in source.messages():
                for answer in work.take(recorded):
                    results.take(answer)
                step()
            for answer in work.finish():
                results.take(answer)
    for note in work.notes:
        typer.echo(f"not used: {note}", err=True)
    if work.without_start:
        typer.echo(
            f"no path was asked for on {work.without_start} maps: no odometry before them tells "
            "where it starts; give --start",
            err=True,
        )
    if not results.count and goal is None:
        asking = bag_files.PATH, bag_files.ODOMETRY
        lacking = [kind for kind in asking if kind not in source.topics]
        what = " and no ".join(lacking) or "drive of two poses"
        typer.echo(f"nothing was asked: the bag has no {what}; give --goal", err=True)
    total = {"answers": results.count, "refused_messages": work.refused, "topics": source.topics}
    typer.echo(json.dumps(total))


class _Results:
    """Writes answers to a folder: messages, predictions and maps."""

    def __init__(self, folder: Path, work: "Replay", bag: "BagWriter"):
        self._folder, self._inputs, self._bag = folder, work.inputs, bag
        self._settings = work.inputs.service.settings
        self._maps: dict[str, str] = {}
        self.count = 0
        """Number of answers."""

    def take(self, answer: "ReplayAnswer") -> None:
        """Write an answer and print it in one line."""
        from rover_planner.maps.known_map import stamp_text

        self.count += 1
        name = f"{self.count:03d}_{answer.kind}"
        entries: dict[str, Any] = {
            "question": self.count,
            "kind": answer.kind,
            "stamp": stamp_text(answer.stamp),
            "traversable": answer.judgement.traversable,
            "reason": answer.judgement.reason,
            "map": self._save_map(answer),
        }
        entries |= self._save_prediction(answer, name)
        self._write_messages(answer)
        typer.echo(json.dumps(entries))

    def _save_map(self, answer: "ReplayAnswer") -> str:
        """Write the map of an answer once; return its file's name."""
        from rover_physics.terrain.grid import save_terrain

        if answer.terrain is None:
            return ""
        key = answer.identity.map_hash
        if key not in self._maps:
            self._maps[key] = f"map_{len(self._maps) + 1:03d}.npz"
            save_terrain(self._folder / self._maps[key], answer.terrain)
        return self._maps[key]

    def _save_prediction(self, answer: "ReplayAnswer", name: str) -> dict[str, Any]:
        """Write prediction and measurements of an answer; return their entries of the report."""
        from rover_physics.files.npz_file import write_npz
        from rover_planner.command.prediction_files import write_prediction
        from rover_planner.planning.path_query import assume

        candidate = answer.judgement.candidate
        if candidate is None or answer.terrain is None:
            return {}
        file, query = f"{name}.npz", self._settings.query
        write_prediction(
            self._folder / file,
            candidate.prediction,
            candidate.verdict,
            assumptions=assume(self._settings.rover, query.model, query.map_sigmas),
        )
        entries: dict[str, Any] = {
            "prediction": file,
            "waypoints": len(candidate.prediction.poses),
        }
        if answer.measured is not None:
            measured = answer.measured
            write_npz(self._folder / f"{name}_measured.npz", vars(measured))
            entries["measured"] = f"{name}_measured.npz"
            entries["suspension"] = measured.compare(candidate.prediction)
        return entries

    def _write_messages(self, answer: "ReplayAnswer") -> None:
        """Write the messages that a server would publish, under its topics."""
        from rover_planner.nodes.result_topics import RESULTS, ResultMessages

        messages = ResultMessages(answer.judgement, answer.identity, answer.stamp, self._inputs)
        for topic, (_, make) in RESULTS.items():
            self._bag.write(f"/traverse_server/{topic}", make(messages), answer.stamp)


def _read_parameters(path: Path | None, given: dict[str, Any]) -> "TraverseServerParameters":
    """Return the parameters of a file, with those that are given over them.

    Raises:
        PlanningError: The file is no parameter file, or a parameter is unknown or wrong.
    """
    from rover_physics.files.yaml_file import read_yaml
    from rover_planner.parameters.table import specs_of
    from rover_planner.parameters.traverse_server import TraverseServerParameters

    content: dict[str, Any] = {}
    if path is not None:
        read = read_yaml(path)
        parts = [read.get(key) for key in NODE_KEYS] if isinstance(read, dict) else []
        found = [part.get("ros__parameters") for part in parts if isinstance(part, dict)]
        if not any(isinstance(part, dict) for part in found):
            raise PlanningError(f"{path} is no parameter file; it needs /**: ros__parameters:")
        for part in found:
            content |= part if isinstance(part, dict) else {}
    content |= {name: value for name, value in given.items() if value}
    known = {spec.name for spec in specs_of(TraverseServerParameters)}
    unknown = sorted(content.keys() - known - {"use_sim_time"})
    if unknown:
        raise PlanningError(f"{path}: traverse_server has no parameter {unknown[0]}")
    values: dict[str, Any] = {
        name: tuple(content[name]) if isinstance(content[name], list) else content[name]
        for name in known & content.keys()
    }
    return TraverseServerParameters(**values)
