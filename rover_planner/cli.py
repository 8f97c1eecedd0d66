"""The command `rover_planner`: predict a path, make a terrain, run the demo, draw Figure 4."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from rover_physics.errors import RoverError
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


@app.command()
def predict(
    rover: Annotated[
        str, typer.Argument(metavar="ROVER", help="Preset name (lsr1, m2020) or rover file.")
    ],
    terrain: Annotated[Path, typer.Argument(metavar="TERRAIN", help="Elevation map, .npz.")],
    poses: Annotated[
        Path, typer.Argument(metavar="POSES", help="Poses x, y, yaw of the body, .npz.")
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Predictions, .npz; is overwritten.")],
    friction: Annotated[
        float | None, typer.Option(metavar="MU", help="Coulomb friction everywhere.")
    ] = None,
    max_torque: Annotated[
        float | None, typer.Option(metavar="TAU", help="Largest wheel torque [N m].")
    ] = None,
    policy: Annotated[
        str, typer.Option(metavar="equal|optimal", help="How the wheels share the traction.")
    ] = "equal",
) -> None:
    """Predict loads, slip and margins along a path of poses and write them to a file.

    Exit code 0 when it ran, whatever the verdict; 2 for bad input.
    """
    from rover_physics.rover import load_rover
    from rover_physics.terrain import load_terrain
    from rover_physics.trap import judge_path
    from rover_planner.prediction_files import read_poses, write_prediction
    from rover_planner.progress import show_progress

    model = load_rover(rover)
    ground = load_terrain(terrain)
    path = read_poses(poses)
    with show_progress() as progress:
        progress(f"sweep {len(path)} poses of {model.name} (the first run compiles the model)")
        prediction, verdict = judge_path(
            model, ground, path, friction=friction, max_torque=max_torque, policy=policy
        )
    write_prediction(out, prediction, verdict)


@app.command()
def terrain(
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="Elevation map to write, .npz; is overwritten.")
    ],
    seed: Annotated[int, typer.Option(help="Seed of all that is random.")] = 1,
    size: Annotated[float, typer.Option(help="Width and height [m].")] = 24.0,
    resolution: Annotated[float, typer.Option(help="Cell size [m].")] = 0.05,
    roughness: Annotated[
        float, typer.Option(help="RMS height difference of points 1 m apart [m].")
    ] = 0.04,
    rocks: Annotated[float, typer.Option(help="Fraction of the ground that rocks cover.")] = 0.03,
    craters: Annotated[
        float, typer.Option(help="Craters of 1 m and larger per square metre.")
    ] = 0.02,
) -> None:
    """Make a Mars-like terrain with fractal relief, craters and rocks."""
    from rover_physics.terrain import save_terrain
    from rover_planner.mars_terrain import make_mars_terrain
    from rover_planner.progress import show_progress

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
    from rover_planner.demo import run_demo

    run_demo(map_file, out, rover, seed)


@app.command()
def figure4(
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="Picture to write, .png; is overwritten.")
    ] = Path("figure4.png"),
    rover: Annotated[str, typer.Option(help="Preset name or rover file.")] = "lsr1",
) -> None:
    """Draw Figure 4 of the paper: how the torque of one wheel changes the loads of all."""
    from rover_physics.rover import load_rover
    from rover_planner.figure4 import draw_figure4
    from rover_planner.progress import show_progress

    model = load_rover(rover)
    with show_progress() as progress:
        progress(f"draw {out.name} (the first run compiles the model)")
        draw_figure4(out, model)


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
