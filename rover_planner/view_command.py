"""The command `rover_planner view`: the page that shows the rover on a terrain."""

import contextlib
import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rover_planner.errors import PlanningError

if TYPE_CHECKING:
    from rover_physics.terrain import Terrain
    from rover_planner.viewer.page_base import PageBase
    from rover_planner.viewer.session import ViewSession

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
    if follow and prediction is not None:
        raise PlanningError("--follow and --prediction exclude each other: live or recorded")
    if prediction is not None and terrain is None:
        raise PlanningError("--prediction needs TERRAIN, the map that the prediction is about")
    _need("viser", "the page needs viser: pip install 'rover_planner[view]'")
    if follow:
        _need(
            "rclpy", "--follow needs ROS 2 Jazzy: source it, or pip install 'rover_planner[ros]'"
        )
    from rover_physics.rover import load_rover
    from rover_planner.viewer.session import ViewSession

    model = load_rover(rover)
    ground = _load_or_make(terrain, follow)
    _compile()
    low, high = choose_ends(ground)
    session = ViewSession(model, ground, start or low, goal or high)
    with contextlib.ExitStack() as closing:
        if follow:
            page = _follow(closing, session, host, port, terrain is not None)
        else:
            page = _show(session, host, port, prediction)
        closing.callback(page.close)
        typer.echo(f"open {page.url} in a browser; Ctrl-C ends it")
        with contextlib.suppress(KeyboardInterrupt):
            page.wait()
    typer.echo("ended")


def _need(module: str, text: str) -> None:
    """Refuse to start where a module is missing."""
    if importlib.util.find_spec(module) is None:
        raise PlanningError(text)


def _compile() -> None:
    """Compile the kernels, or load them, before a visitor has to wait for that."""
    from rover_physics.sweep import warm_up
    from rover_planner.progress import show_progress

    with show_progress() as progress:
        progress("compile the model (only the first time takes long)")
        warm_up()


def _show(session: "ViewSession", host: str, port: int, prediction: Path | None) -> "PageBase":
    """Serve a page that plans, or replays a recorded prediction."""
    from rover_planner.prediction_files import read_prediction
    from rover_planner.viewer.page import Page

    if prediction is not None:
        session.replay(*read_prediction(prediction))
    return Page(session, host, port)


def _follow(
    closing: contextlib.ExitStack, session: "ViewSession", host: str, port: int, has_ground: bool
) -> "PageBase":
    """Serve a page that follows a live graph."""
    from rover_planner.viewer.live import LiveLink
    from rover_planner.viewer.live_page import LivePage

    link = LiveLink()
    closing.callback(link.close)
    return LivePage(session, link.listener, host, port, has_ground=has_ground)


def _load_or_make(path: Path | None, follow: bool) -> "Terrain":
    """Load the terrain, or make one; to follow a rover before its map comes, a level one."""
    import numpy as np

    from rover_physics.terrain import Terrain, load_terrain
    from rover_planner.mars_terrain import make_mars_terrain

    if path is not None:
        return load_terrain(path)
    if follow:
        return Terrain(np.zeros((160, 160)), 0.05, (-4.0, -4.0))
    return make_mars_terrain(SEED, TERRAIN_SIZE, 0.05)


def choose_ends(ground: "Terrain") -> tuple[Pose, Pose]:
    """Return two places on the middle line of a map, a quarter and three quarters along it."""
    ny, nx = ground.elevation.shape
    y = ground.origin[1] + ground.resolution * ny * 0.5
    first, last = (ground.origin[0] + ground.resolution * nx * share for share in (0.25, 0.75))
    return (first, y, 0.0), (last, y, 0.0)
