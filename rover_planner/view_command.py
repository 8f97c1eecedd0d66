"""The command `rover_planner view`: the page that shows the rover on a terrain."""

import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rover_planner.errors import PlanningError

if TYPE_CHECKING:
    from rover_physics.terrain import Terrain

TERRAIN_SIZE = 12.0
"""Width of the terrain that is made where none is given [m]."""
SEED = 7
Pose = tuple[float, float, float]


def view(
    rover: Annotated[
        str, typer.Argument(metavar="ROVER", help="Preset name or rover file.")
    ] = "lsr1",
    terrain: Annotated[
        Path | None,
        typer.Argument(metavar="TERRAIN", help="Elevation map, .npz; made if not given."),
    ] = None,
    start: Annotated[
        tuple[float, float, float] | None,
        typer.Option(metavar="X Y YAW", help="Start in m and rad, map frame."),
    ] = None,
    goal: Annotated[
        tuple[float, float, float] | None,
        typer.Option(metavar="X Y YAW", help="Goal in m and rad, map frame."),
    ] = None,
    prediction: Annotated[
        Path | None,
        typer.Option(metavar="OUT", help="Replay what `predict` wrote, instead of planning."),
    ] = None,
    follow: Annotated[
        bool, typer.Option("--follow", help="Follow a live ROS graph instead of planning.")
    ] = False,
    host: Annotated[str, typer.Option(help="Address to serve on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port to serve on; 0 takes a free one.")] = 8080,
) -> None:
    """Show the rover on a terrain in a web page: watch it drive, see why it can or cannot.

    Exit code 0 when it is interrupted; 2 for bad input.
    """
    if importlib.util.find_spec("viser") is None:
        raise PlanningError("the page needs viser: pip install 'rover_planner[view]'")
    from rover_physics.rover import load_rover
    from rover_planner.prediction_files import read_prediction
    from rover_planner.viewer.page import Page
    from rover_planner.viewer.session import ViewSession

    ground = _load_or_make(terrain)
    low, high = choose_ends(ground)
    session = ViewSession(load_rover(rover), ground, start or low, goal or high)
    if prediction is not None:
        session.replay(*read_prediction(prediction))
    page = Page(session, host, port)
    if follow:
        from rover_planner.viewer.live import following

        following(page)
    typer.echo(f"open {page.url} in a browser; Ctrl-C ends it")
    try:
        page.wait()
    except KeyboardInterrupt:
        typer.echo("ended")
    finally:
        page.close()


def _load_or_make(path: Path | None) -> "Terrain":
    from rover_physics.terrain import load_terrain
    from rover_planner.mars_terrain import make_mars_terrain

    return make_mars_terrain(SEED, TERRAIN_SIZE, 0.05) if path is None else load_terrain(path)


def choose_ends(ground: "Terrain") -> tuple[Pose, Pose]:
    """Return two places on the middle line of a map, a quarter and three quarters along it."""
    ny, nx = ground.elevation.shape
    y = ground.origin[1] + ground.resolution * ny * 0.5
    first, last = (ground.origin[0] + ground.resolution * nx * share for share in (0.25, 0.75))
    return (first, y, 0.0), (last, y, 0.0)
