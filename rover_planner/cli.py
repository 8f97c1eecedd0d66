"""The command `rover_planner`: predict, reach, study, view, terrain, demo, figure4."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from rover_physics.errors import RoverError
from rover_planner.command.extras import need
from rover_planner.command.study import study
from rover_planner.command.view import view
from rover_planner.errors import DemoError, PlanningError

BAD_INPUT = 2
"""Exit code when the input makes no sense, with one line on stderr that says why."""
FAILED = 1
"""Exit code when the input was good but a part of the system failed."""
INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""

app = typer.Typer(
    help="Can a rocker-bogie rover traverse this path?",
    add_completion=False,
    pretty_exceptions_enable=False,
)


RoverName = Annotated[
    str, typer.Argument(metavar="ROVER", help="Preset name (lsr1, m2020) or rover file.")
]
TerrainFile = Annotated[Path, typer.Argument(metavar="TERRAIN", help="Elevation map, .npz.")]
Friction = Annotated[float | None, typer.Option(metavar="MU", help="Coulomb friction everywhere.")]
MaxTorque = Annotated[
    float | None, typer.Option(metavar="TAU", help="Largest wheel torque in N m.")
]
Policy = Annotated[
    str, typer.Option(metavar="equal|optimal", help="How the wheels share the traction.")
]
SoilName = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="Preset soil where the terrain names none (docs/soil.md)."),
]
Payload = Annotated[float | None, typer.Option(metavar="KG", help="Mass at the arm's tip in kg.")]
Vector = tuple[float, float, float]


@app.command()
def predict(
    rover: RoverName,
    terrain: TerrainFile,
    poses: Annotated[
        Path, typer.Argument(metavar="POSES", help="Poses x, y, yaw of the body, .npz.")
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Predictions, .npz; is overwritten.")],
    friction: Friction = None,
    max_torque: MaxTorque = None,
    policy: Policy = "equal",
    soil: SoilName = None,
    arm: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=RAD", help="Angle of a joint of the arm in rad; give all."),
    ] = None,
    payload: Payload = None,
    tool_force: Annotated[
        Vector | None,
        typer.Option(metavar="FX FY FZ", help="Force on the arm's tip in N, body frame."),
    ] = None,
    tool_moment: Annotated[
        Vector | None,
        typer.Option(metavar="MX MY MZ", help="Moment on the arm's tip in N m, body frame."),
    ] = None,
    sigmas: Annotated[
        float,
        typer.Option(
            metavar="K",
            help="Standard deviations to allow for where the map has elevation_std; 0: none.",
        ),
    ] = 3.0,
    classes: Annotated[
        bool,
        typer.Option(
            "--classes",
            help="Add the class of each waypoint, by both torque policies.",
        ),
    ] = False,
    torque_ranges: Annotated[
        bool,
        typer.Option("--torque-ranges", help="Add the torques with which each wheel can do."),
    ] = False,
) -> None:
    """Predict loads, slip and margins along a path of poses and write them to a file.

    Exit code 0 when it ran, whatever the verdict; 2 for bad input.
    """
    from rover_physics.prediction.sweep_options import SweepOptions
    from rover_physics.rover.rover_file import load_rover
    from rover_physics.terrain.grid import load_terrain
    from rover_physics.traversability.classification import classify_judged
    from rover_physics.traversability.judge_path import judge_path
    from rover_physics.traversability.torque_ranges import find_torque_ranges
    from rover_planner.command.arm_options import read_arm_angles
    from rover_planner.command.prediction_files import read_poses, write_prediction
    from rover_planner.progress import show_progress

    model = load_rover(rover)
    ground = load_terrain(terrain)
    path = read_poses(poses)
    options = SweepOptions(
        policy=policy,
        friction=friction,
        max_torque=max_torque,
        soil=soil,
        joint_angles=read_arm_angles(model, arm or ()),
        payload=payload,
        tool_force=tool_force,
        tool_moment=tool_moment,
    )
    with show_progress() as progress:
        progress(f"sweep {len(path)} poses of {model.name} (the first run compiles the model)")
        judged = judge_path(model, ground, path, options, sigmas=sigmas)
        if classes:
            progress("classify the waypoints")
        found = (
            classify_judged(model, ground, *judged, options, sigmas=sigmas) if classes else None
        )
        if torque_ranges:
            progress("find the ranges of the torques")
        ranges = find_torque_ranges(model, ground, path, options) if torque_ranges else None
    on_soil = soil is not None or bool(ground.soil_names)
    write_prediction(out, *judged, on_soil=on_soil, classes=found, ranges=ranges)


@app.command(context_settings={"ignore_unknown_options": True})  # so that -1.5 is a number
def reach(
    rover: RoverName,
    terrain: TerrainFile,
    x: Annotated[float, typer.Argument(metavar="X", help="Place of the body in m, map frame.")],
    y: Annotated[float, typer.Argument(metavar="Y")],
    yaw: Annotated[float, typer.Argument(metavar="YAW", help="Heading of the body in rad.")],
    tx: Annotated[float, typer.Argument(metavar="TX", help="Place for the tip in m, map frame.")],
    ty: Annotated[float, typer.Argument(metavar="TY")],
    tz: Annotated[float, typer.Argument(metavar="TZ")],
    force: Annotated[
        Vector | None,
        typer.Option(metavar="FX FY FZ", help="Force on the tip there in N, map frame."),
    ] = None,
    moment: Annotated[
        Vector | None,
        typer.Option(metavar="MX MY MZ", help="Moment on the tip there in N m, map frame."),
    ] = None,
    payload: Payload = None,
    friction: Friction = None,
    max_torque: MaxTorque = None,
    policy: Policy = "equal",
    soil: SoilName = None,
) -> None:
    """Tell as JSON whether the rover at rest can reach a point with its arm, and push there.

    Exit code 0 when it ran, whatever the answer; 2 for bad input.
    """
    from rover_physics.prediction.sweep_options import SweepOptions
    from rover_physics.rover.rover_file import load_rover
    from rover_physics.terrain.grid import load_terrain
    from rover_physics.traversability.reach import judge_reach
    from rover_planner.progress import show_progress

    model, ground = load_rover(rover), load_terrain(terrain)
    with show_progress() as progress:
        progress(f"ask {model.name} (the first run compiles the model)")
        answer = judge_reach(
            model,
            ground,
            (x, y, yaw),
            (tx, ty, tz),
            SweepOptions(
                payload=payload, friction=friction, max_torque=max_torque, policy=policy, soil=soil
            ),
            force=force,
            moment=moment,
        )
    print(json.dumps(answer.to_dict(), allow_nan=False))


@app.command()
def terrain(
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="Elevation map to write, .npz; is overwritten.")
    ],
    seed: Annotated[int, typer.Option(help="Seed of all that is random.")] = 1,
    size: Annotated[float, typer.Option(help="Width and height in m.")] = 24.0,
    resolution: Annotated[float, typer.Option(help="Cell size in m.")] = 0.05,
    roughness: Annotated[
        float, typer.Option(help="RMS height difference of points 1 m apart in m.")
    ] = 0.04,
    rocks: Annotated[float, typer.Option(help="Fraction of the ground that rocks cover.")] = 0.03,
    craters: Annotated[
        float, typer.Option(help="Craters of 1 m and larger per square metre.")
    ] = 0.02,
) -> None:
    """Make a Mars-like terrain with fractal relief, craters and rocks."""
    from rover_physics.terrain.grid import save_terrain
    from rover_planner.progress import show_progress
    from rover_planner.worlds.mars_terrain import make_mars_terrain

    with show_progress() as progress:
        progress("make the terrain")
        made = make_mars_terrain(
            seed,
            size,
            resolution,
            roughness=roughness,
            rock_cover=rocks,
            crater_density=craters,
        )
    save_terrain(out, made)


@app.command()
def demo(
    map_file: Annotated[
        Path | None, typer.Option("--map", help="Elevation map, .npz; by default one is made.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Picture to write, .png.")] = Path(
        "demo_output/demo.png"
    ),
    rover: Annotated[str, typer.Option(help="Preset name or rover file.")] = "lsr1",
    seed: Annotated[int, typer.Option(help="Seed of the terrain and the goals.")] = 1,
) -> None:
    """Ask a running traverse_server over ROS 2 for several goals, and picture its answers."""
    from rover_planner.demo.demo import run_demo

    run_demo(map_file, out, rover, seed)


@app.command()
def figure4(
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="Picture to write, .png; is overwritten.")
    ] = Path("figure4.png"),
    rover: Annotated[str, typer.Option(help="Preset name or rover file.")] = "lsr1",
) -> None:
    """Draw Figure 4 of the paper: how the torque of one wheel changes the loads of all."""
    need("matplotlib", "the picture")
    from rover_physics.rover.rover_file import load_rover
    from rover_planner.figures.figure4 import draw_figure4
    from rover_planner.progress import show_progress

    model = load_rover(rover)
    with show_progress() as progress:
        progress(f"draw {out.name} (the first run compiles the model)")
        draw_figure4(out, model)


app.command()(study)
app.command(context_settings={"ignore_unknown_options": True})(view)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code; bad input is one line on stderr."""
    command = typer.main.get_command(app)
    try:
        code = command.main(
            args=None if arguments is None else list(arguments),
            prog_name="rover_planner",
            standalone_mode=False,
        )
    except (RoverError, PlanningError) as error:
        return _refuse(str(error))
    except DemoError as error:
        _refuse(str(error))
        return FAILED
    except KeyboardInterrupt:
        return INTERRUPTED
    except Exception as error:
        # usage errors; typer has carried its own copy of click since 0.17, so no class to name
        if hasattr(error, "format_message"):
            return _refuse(error.format_message())
        if type(error).__name__ == "Abort":
            return INTERRUPTED
        raise
    return code if isinstance(code, int) else 0


def _refuse(text: str) -> int:
    """Print why the input is refused, on one line."""
    print("rover_planner:", " ".join(text.split()), file=sys.stderr)
    return BAD_INPUT
