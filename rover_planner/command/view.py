"""The command `rover_planner view`: the page that shows the rover on a terrain."""

import contextlib
import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rover_planner.command.options import MaxGap, RoverName, Vector
from rover_planner.errors import PlanningError
from rover_planner.shell.extras import need

if TYPE_CHECKING:
    from rover_physics.rover.model import Rover
    from rover_physics.terrain.grid import Terrain
    from rover_planner.viewer.pages.page_base import PageBase
    from rover_planner.viewer.state.session import ViewSession

TERRAIN_SIZE = 12.0
"""Width of the terrain that is made where none is given [m]."""
SEED = 7
MAX_DEMO_LENGTH = 10.0
"""Largest distance of the ends that are chosen where none are given [m]."""
PLACES_TRIED = 41
"""Places along each side of the map that are tried for an end."""
Pose = tuple[float, float, float]


def view(
    rover: RoverName = "lsr1",
    terrain: Annotated[
        str | None,
        typer.Argument(
            metavar="TERRAIN",
            help="Preset name (spirit) or elevation map, .npz; made if not given.",
        ),
    ] = None,
    start: Annotated[
        Vector | None,
        typer.Option(metavar="X Y YAW", help="Start in m and rad, map frame."),
    ] = None,
    goal: Annotated[
        Vector | None,
        typer.Option(metavar="X Y YAW", help="Goal in m and rad, map frame."),
    ] = None,
    max_gap: MaxGap = 0.2,
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
    need("viser", "the page")
    if follow:
        need("rclpy", "--follow")
    from rover_physics.rover.rover_file import load_rover
    from rover_planner.viewer.state.session import ViewSession

    model = load_rover(rover)
    ground = _load_or_make(terrain, follow)
    if prediction is None:  # what was predicted was predicted on the map as it is
        ground = ground.fill_gaps(max_gap)
    _compile()
    low, high = choose_ends(model, ground)
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


def _compile() -> None:
    """Compile the kernels, or load them, before a visitor has to wait for that."""
    from rover_physics.warm_up import warm_up
    from rover_planner.progress import show_progress

    with show_progress() as progress:
        progress("compile the model (only the first time takes long)")
        warm_up()


def _show(session: "ViewSession", host: str, port: int, prediction: Path | None) -> "PageBase":
    """Serve a page that plans, or replays a recorded prediction."""
    from rover_planner.command.prediction_files import read_prediction
    from rover_planner.viewer.pages.page import Page

    if prediction is not None:
        session.replay(*read_prediction(prediction))
    return Page(session, host, port)


def _follow(
    closing: contextlib.ExitStack, session: "ViewSession", host: str, port: int, has_ground: bool
) -> "PageBase":
    """Serve a page that follows a live graph."""
    from rover_planner.viewer.live.listener import LiveLink
    from rover_planner.viewer.pages.live_page import LivePage

    link = LiveLink()
    closing.callback(link.close)
    return LivePage(session, link.listener, host, port, has_ground=has_ground)


def _load_or_make(name: str | None, follow: bool) -> "Terrain":
    """Load the terrain, or make one; to follow a rover before its map comes, a level one."""
    import numpy as np

    from rover_physics.terrain.grid import Terrain, load_terrain
    from rover_planner.worlds.mars_terrain import make_mars_terrain

    if name is not None:
        return load_terrain(name)
    if follow:
        return Terrain(np.zeros((160, 160)), 0.05, (-4.0, -4.0))
    return make_mars_terrain(SEED, TERRAIN_SIZE, 0.05)


def choose_ends(rover: "Rover", ground: "Terrain") -> tuple[Pose, Pose]:
    """Return two places where the rover can stand, with known ground between them.

    They are on both sides of the middle of the map if that is so there, else where the map has
    known ground: a start and the farthest of the goals that a demo asks for on the plain. Where
    there is no such place they are on both sides all the same, and the page says why not.
    """
    import numpy as np

    low, high = _ends_about_the_middle(rover, ground)
    way = np.linspace(low[:2], high[:2], PLACES_TRIED)
    if np.isfinite(ground.elevation_at(way[:, 0], way[:, 1])).all():
        return low, high
    return _ends_on_known_ground(rover, ground) or (low, high)


def _ends_on_known_ground(rover: "Rover", ground: "Terrain") -> tuple[Pose, Pose] | None:
    """Return a start and the farthest goal on the plain, None where the map has none."""
    from rover_planner.planning.goals import choose_mission

    try:
        mission = choose_mission(ground, rover)
    except PlanningError:
        return None
    plain = [goal.pose for goal in mission.goals if goal.intent == "plain"]
    return (mission.start, max(plain, key=partial(math.dist, mission.start))) if plain else None


def _ends_about_the_middle(rover: "Rover", ground: "Terrain") -> tuple[Pose, Pose]:
    """Return two places where the rover can stand, on both sides of the middle of a map.

    Each is the nearest to a quarter and three quarters of the way along x, at most MAX_DEMO_LENGTH
    apart; where the rover can stand nowhere they are just there.
    """
    import numpy as np

    from rover_physics.prediction.map_sweep import score_poses

    x_low, x_high, y_low, y_high = ground.bounds
    middle = np.array([0.5 * (x_low + x_high), 0.5 * (y_low + y_high)])
    half = 0.5 * min(0.5 * (x_high - x_low), MAX_DEMO_LENGTH)
    x, y = np.meshgrid(
        np.linspace(x_low, x_high, PLACES_TRIED), np.linspace(y_low, y_high, PLACES_TRIED)
    )
    wanted = middle + np.array([[-half, 0.0], [half, 0.0]])
    places = np.vstack([wanted, np.column_stack([x.ravel(), y.ravel()])])
    poses = np.column_stack([places, np.zeros(len(places))])
    stands = score_poses(rover, ground, poses).within_limits(rover)
    ends: list[Pose] = []
    for aim, side in zip(wanted, (-1.0, 1.0), strict=True):
        fit = stands & (side * (places[:, 0] - middle[0]) > 0.0)
        away = np.where(fit, np.linalg.norm(places - aim, axis=1), np.inf)
        best = places[np.argmin(away)] if fit.any() else aim
        ends.append((float(best[0]), float(best[1]), 0.0))
    return ends[0], ends[1]
