# SPDX-License-Identifier: Apache-2.0
"""Keeps the hazard map in a thread; publishes it latched and serves ~/get_hazard_map."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import GetMap
from std_msgs.msg import Header

from msg_adapters.results.grids import VALUES, occupancy_grid
from rover_physics.errors import RoverError
from rover_physics.numerics.interruption import interruptible
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.pose_classes import UNKNOWN, RoverOnMap
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.budget import STOPPING, QuestionStoppedError
from rover_planner.planning.answering.service_settings import ServiceSettings
from rover_planner.planning.answering.traverse_service import TraverseService
from rover_planner.planning.navigation.hazard_map import HazardMap, HazardView
from rover_planner.ros.lazy_publisher import LazyPublisher
from rover_planner.ros.node import RoverNode

PERIOD = 0.5
"""Time between two looks for a new map [s]; comparing two large maps takes a tenth of it."""
SLICE = 0.2
"""Time after which the thread looks for a newer map, and for questions [s]."""
SHOW_PERIOD = 1.0
"""Time between two publications while cells wait to be judged [s]."""
MAX_PAUSE = 1.0
"""Longest pause for questions in a SLICE [s]; they wait for some 10 ms of work at most."""
END_TIME = 2.0
"""Longest wait for the thread at the end [s]."""


class HazardTopics:
    """Connects a HazardMap to a node; without the parameter `hazard_map` it does nothing."""

    def __init__(
        self,
        node: RoverNode[TraverseServerParameters],
        service: TraverseService,
        give_way: Callable[[Callable[[], object], float], float],
    ):
        """Create topics, service and thread.

        Args:
            node: The node.
            service: Knows map, settings and pose.
            give_way: As `QuestionDesk.give_way`: questions come first.
        """
        self._node, self._service, self._give_way = node, service, give_way
        self._hazards: HazardMap | None = None  # set in the executor's thread
        self._shown: _Shown | None = None
        self._done: tuple[HazardMap, Terrain, ServiceSettings] | None = None
        self._topics: dict[str, LazyPublisher] = {}
        node.create_service(GetMap, "~/get_hazard_map", self._get)
        self._ending = threading.Event()
        self._patience = 0.0
        self.apply()
        self._thread = threading.Thread(target=self._run, name="hazards", daemon=True)
        self._thread.start()

    def apply(self) -> None:
        """Follow the parameter `hazard_map`; without it the topics do not come into being."""
        if not self._node.values.hazard_map:
            self._hazards = None
            self._withdraw()
        elif self._hazards is None:
            headings = (f"heading_{k}" for k in range(self._node.values.hazard_headings))
            for name in ("worst", "best", *headings):
                if name not in self._topics:
                    topic = LazyPublisher(self._node, OccupancyGrid, f"~/hazard_map/{name}")
                    self._topics[name] = topic
            self._hazards = HazardMap(self._node.values.hazard_headings)

    def _start_over(self) -> None:
        """Forget the classes, whose update has failed."""
        self._hazards = None
        self.apply()

    def _withdraw(self) -> None:
        """Publish that no class is known: nobody judges what changes from now on."""
        shown, self._shown = self._shown, None
        if shown is None:
            return
        blank = shown.without_classes(self._make_header())
        for name, topic in self._topics.items():
            topic.publish(partial(blank.grid, name))

    def close(self) -> None:
        """End the thread."""
        self._ending.set()
        self._thread.join(END_TIME)

    def describe(self) -> dict[str, Any]:
        """Return keys and values for diagnostics."""
        shown = self._shown
        if shown is None:
            return {}
        return {"hazard map: cells to judge": shown.stale, "hazard map: map": shown.map_hash}

    def _get(self, _request: GetMap.Request, response: GetMap.Response) -> GetMap.Response:
        """Return the worst classes; a grid without cells if there are none."""
        shown = self._shown
        if shown is not None:
            response.map = shown.grid("worst")
            return response
        missing = "no cell was judged yet"
        if self._hazards is None:
            missing = "the parameter hazard_map is false"
        elif self._service.known_map is None:
            missing = "there is no map yet"
        self._node.get_logger().warning(f"get_hazard_map: an empty grid, {missing}")
        return response

    def catch_up(self) -> None:
        """Publish the grids to new subscribers."""
        for topic in list(self._topics.values()):
            topic.catch_up()

    def _run(self) -> None:
        while not self._ending.wait(PERIOD):
            try:
                with interruptible(self._let_questions_go_first):
                    self._update(self._hazards)
            except QuestionStoppedError:
                return
            except RoverError as error:  # such as a soil of the map that is not known
                self._node.get_logger().warning(f"no hazard map: {error}", once=True)
            except Exception as error:
                self._node.guard.report("hazard map", error)
                self._node.handover.call(self._start_over)

    def _check_end(self) -> None:
        if self._ending.is_set():
            raise QuestionStoppedError(STOPPING, "the server is shutting down")

    def _update(self, hazards: HazardMap | None) -> None:
        """Take the present map, judge what is stale, and publish; newer maps are followed."""
        shown_at, is_done = time.monotonic(), False
        while not is_done and hazards is not None and hazards is self._hazards:
            known, settings = self._service.known_map, self._service.settings
            if known is None or self._done == (hazards, known.terrain, settings):
                return
            query = settings.query
            hazards.take(RoverOnMap(settings.rover, known.terrain, query.model, query.map_sigmas))
            self._patience = MAX_PAUSE
            self._let_questions_go_first()  # in work it would take time from the slice
            pose = self._service.fresh_pose()
            is_done = hazards.work(SLICE, None if pose is None else (pose[0], pose[1]))
            if is_done:
                self._done = hazards, known.terrain, settings
            if is_done or time.monotonic() - shown_at > SHOW_PERIOD:
                shown_at = time.monotonic()
                self._show(hazards, known.fingerprint)

    def _let_questions_go_first(self) -> None:
        """Wait while there are questions, for MAX_PAUSE in each SLICE; called between poses."""
        self._patience -= self._give_way(self._check_end, self._patience)

    def _show(self, hazards: HazardMap, map_hash: str) -> None:
        view = hazards.view()
        if view is not None:
            shown = _Shown(view, map_hash, hazards.stale_count, self._make_header())
            self._node.handover.call(partial(self._publish, hazards, shown))

    def _make_header(self) -> Header:
        stamp = self._node.get_clock().now().to_msg()
        return Header(frame_id=self._node.values.map_frame, stamp=stamp)

    def _publish(self, hazards: HazardMap, shown: "_Shown") -> None:
        """Publish a view of the present hazard map; called in the executor's thread."""
        if hazards is self._hazards:
            self._shown = shown
            for name, topic in self._topics.items():
                topic.publish(partial(shown.grid, name))


@dataclass(frozen=True, eq=False)
class _Shown:
    """A view of the classes as it is published."""

    view: HazardView
    """The classes."""
    map_hash: str
    """Fingerprint of the map they were judged on."""
    stale: int
    """Number of poses that were not judged yet; they are unknown."""
    header: Header
    """Frame of the map, and stamp, of all grids."""

    def without_classes(self, header: Header) -> "_Shown":
        """Return the same cells, none of them judged, at another time."""
        unknown = np.full_like(self.view.classes, UNKNOWN)
        return replace(self, view=replace(self.view, classes=unknown), header=header)

    def grid(self, name: str) -> OccupancyGrid:
        """Return the grid of a topic."""
        view = self.view
        if name in ("worst", "best"):
            classes = view.worst() if name == "worst" else view.best()
        else:
            classes = view.classes[int(name.removeprefix("heading_"))]
        grid = view.grid
        return occupancy_grid(VALUES[classes], grid.resolution, grid.anchor, self.header)
