"""Colours the ground in the background: a layer that is predicted for the rover takes seconds."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from rover_planner.viewer.panel.ground_tab import GroundTab
from rover_planner.viewer.scene.ground_mesh import GroundMesh, build_ground_mesh
from rover_planner.viewer.scene.scene import Scene
from rover_planner.viewer.state.background_work import BackgroundWork, Report
from rover_planner.viewer.state.scenario import Scenario


@dataclass(frozen=True, eq=False)
class PaintRequest:
    """What to draw."""

    scenario: Scenario
    """Rover, ground and options."""
    layer: str
    """Name of the layer."""
    heading: float
    """Yaw of the rover, where the layer is predicted [rad]."""


class GroundPainter:
    """Draws the ground in the colours of the layer that the tab names."""

    def __init__(self, scene: Scene, tab: GroundTab, wake: Callable[[], object]):
        """Start the thread; it calls `wake` when there is something for `show_painted`."""
        self._scene, self._tab = scene, tab
        self._asked: PaintRequest | None = None
        self.work: BackgroundWork[PaintRequest, GroundMesh] = BackgroundWork(
            _paint, wake, "ground"
        )

    def paint(self, scenario: Scenario) -> None:
        """Begin to colour the ground for a scenario."""
        heading = float(np.radians(self._tab.heading))
        self._asked = PaintRequest(scenario, self._tab.layer, heading)
        self.work.ask(self._asked)

    def show_painted(self) -> None:
        """Show the ground if it is finished.

        Raises:
            Exception: It failed.
        """
        for one in self.work.take():
            if one.request is not self._asked:
                continue
            if one.error is not None:
                raise one.error
            if one.result is not None:
                self._scene.draw_ground(one.result.mesh)
                self._tab.show_scale(one.result.scale)


def _paint(request: PaintRequest, report: Report) -> Iterator[GroundMesh]:
    report("colouring the ground", 1, 1)
    asked = request.scenario
    options = asked.options.sweep_options(asked.arm_angles)
    yield build_ground_mesh(asked.rover, asked.terrain, request.layer, request.heading, options)
