"""The page: a viser server, what is shown on it, and what its controls do to the session."""

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from rover_physics.rover import load_rover, preset_names
from rover_physics.soil_file import load_soils
from rover_planner.viewer.board import describe_verdict, draw_board
from rover_planner.viewer.charts import Charts
from rover_planner.viewer.controls import NO_SOIL, Player, PlayerActions, RoverSliders
from rover_planner.viewer.ground_mesh import LAYERS, ground_mesh, hit_ground
from rover_planner.viewer.live_frame import LiveFigure
from rover_planner.viewer.overlays import ForceArrows, PathOverlay
from rover_planner.viewer.playback import Playback
from rover_planner.viewer.rover_figure import RoverFigure
from rover_planner.viewer.rover_values import RoverValue, read_rover, write_rover
from rover_planner.viewer.session import REFUSALS, ViewSession

FRAME = 0.04
"""Time between two pictures [s]."""
BOARD_FRAME = 0.12
"""The same for board and plots, which cost the page more [s]."""
REST = 0.3
"""Time after the last change of the rover when all candidates are judged anew [s]."""


class Page:
    """Everything on the page: one thread moves it, its callbacks change the session."""

    def __init__(self, session: ViewSession, host: str = "127.0.0.1", port: int = 8080):
        """Start to serve a session; `port` 0 takes a free one."""
        import viser

        self.session = session
        self.playback = Playback()
        self._lock = threading.RLock()
        self._ended = threading.Event()
        self._changed_at: float | None = None
        self._clicks = "goal"
        self._moved = True
        self._listener: Any = None
        self._live: LiveFigure | None = None
        self._told: tuple[Any, ...] = ()
        self._layer = "height"
        self.server = viser.ViserServer(host, port, label="rover_planner", verbose=False)
        self.server.gui.configure_theme(show_logo=False, show_share_button=False)
        self.server.scene.set_up_direction("+z")
        self.server.scene.configure_default_lights(cast_shadow=False)
        self.server.scene.configure_environment_map(environment_intensity=0.25)
        self.server.on_client_connect(self._look_at_start)
        self._build()
        self._take_all()
        self.server.scene.on_click()(self._click)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"http://{self.server.get_host()}:{self.server.get_port()}"

    def follow(self, listener: Any) -> None:
        """Show what a `LiveListener` hears instead of what the session plans."""
        with self._lock:
            self._listener = listener
            self._live = LiveFigure(self.session.rover)

    def close(self) -> None:
        """End the page."""
        self._ended.set()
        self._thread.join(5.0)
        self.server.stop()

    def wait(self) -> None:
        """Serve until the page is closed or the program is interrupted."""
        while not self._ended.wait(0.5):
            pass

    # What is on the page.

    def _build(self) -> None:
        gui = self.server.gui
        gui.main_panel.dock_right()
        gui.main_panel.set_width(370)
        tabs = gui.add_tab_group()
        with tabs.add_tab("Drive"):
            self._player = Player(gui, self._player_actions(), self.playback.speed)
            self._verdict = gui.add_html("")
            self._board = gui.add_html("")
        self._rover_tab = tabs.add_tab("Rover")
        with self._rover_tab:
            self._build_rover_tab()
        with tabs.add_tab("Ground and path"):
            self._build_path_tab()
        plots = gui.add_panel()
        with plots.add_tab("Plots over distance [m]"):
            self._charts = Charts(gui)
        plots.dock_left()
        plots.set_width(300)
        self._paths = PathOverlay(self.server.scene)

    def _player_actions(self) -> PlayerActions:
        playback = self.playback

        def start(move: Callable[[], None]) -> Callable[[], None]:
            def act() -> None:
                move()
                self._moved = True

            return act

        def seek(percent: float) -> None:
            playback.pause()
            playback.jump(0.01 * percent * playback.duration)
            self._moved = True

        def step(by: int) -> None:
            playback.step(self.session.shown.journey.times, by)
            self._moved = True

        def set_speed(speed: float) -> None:
            playback.speed = speed

        return PlayerActions(
            start(playback.play), start(playback.pause), start(playback.rewind),
            start(playback.fast_forward),
            lambda: step(-1), lambda: step(1), seek, set_speed,
        )  # fmt: skip

    def _build_rover_tab(self) -> None:
        gui = self.server.gui
        self._note = gui.add_html("")
        preset = gui.add_dropdown("Preset", preset_names(), initial_value=None)
        preset.on_update(lambda event: self._load(lambda: load_rover(event.target.value)))
        upload = gui.add_upload_button("Load rover file", mime_type=".yaml,.yml")
        upload.on_upload(
            lambda event: self._load(
                lambda: read_rover(
                    event.target.value.content.decode("utf-8", "replace"), event.target.value.name
                )
            )
        )
        save = gui.add_button("Save rover file")
        save.on_click(self._send_rover)
        self._sliders: RoverSliders | None = None
        self._slider_home = gui.add_folder("Values")
        self._arm_sliders: list[Any] = []

    def _build_path_tab(self) -> None:
        gui = self.server.gui
        clicks = gui.add_dropdown("A click sets", ("goal", "start"), initial_value="goal")

        def choose(event: Any) -> None:
            self._clicks = event.target.value

        clicks.on_update(choose)
        self._choice = gui.add_dropdown("Path shown", ("best",))
        self._choice.on_update(lambda event: self._choose_path(event) if event.client else None)
        policy = gui.add_dropdown("Torques", ("equal", "optimal"))
        policy.on_update(lambda event: self._set_options(policy=event.target.value))
        soil = gui.add_dropdown("Soil", (NO_SOIL, *load_soils()))
        soil.on_update(
            lambda event: self._set_options(
                soil=None if event.target.value == NO_SOIL else event.target.value
            )
        )
        layer = gui.add_dropdown("Colour by", tuple(LAYERS), initial_value="height")

        def recolour(event: Any) -> None:
            self._layer = event.target.value
            with self._lock:
                self._draw_ground()

        layer.on_update(recolour)
        self._scale = gui.add_html("")
        forces = gui.add_checkbox("Forces", True)

        def show_forces(event: Any) -> None:
            self._forces.visible = event.target.value

        forces.on_update(show_forces)

    def _look_at_start(self, client: Any) -> None:
        """Let a new visitor look along the way from behind and beside the rover."""
        start, goal = np.array(self.session.start), np.array(self.session.goal)
        ahead = goal[:2] - start[:2]
        length = max(float(np.linalg.norm(ahead)), 1.0)
        beside = np.array([ahead[1], -ahead[0]]) / length
        height = float(np.nan_to_num(self.session.terrain.elevation_at(*start[:2])))
        away = 0.25 * length + 6.0 * self.session.rover.wheel.radius
        place = start[:2] - 0.8 * away * ahead / length + 0.9 * away * beside
        client.camera.position = (*place, height + 0.9 * away)
        client.camera.look_at = (*(start[:2] + 0.12 * ahead), height)

    # What the session holds, onto the page.

    def _take_all(self) -> None:
        """Show another rover, terrain or answer."""
        with self._lock:
            self._draw_ground()
            self._draw_rover()
            self._draw_sliders()
            self._take_answer()

    def _draw_ground(self) -> None:
        session = self.session
        heading = float(np.arctan2(*(np.subtract(session.goal, session.start)[1::-1])))
        mesh, (low, high) = ground_mesh(session.rover, session.terrain, self._layer, heading)
        self.server.scene.add_mesh_trimesh("/ground", mesh)
        unit = {"height": "m", "slope": "rad", "tilt": "rad", "belly clearance": "m"}.get(
            self._layer, "-"
        )
        self._scale.content = (
            '<div style="font-size:12px">'
            '<div style="height:10px;background:linear-gradient(90deg,#00224e,#7d7c78,#fee838)">'
            f"</div>{low:.2f} to {high:.2f} {unit}, grey where not known</div>"
        )

    def _draw_rover(self) -> None:
        scene = self.server.scene
        self._figure = RoverFigure(scene, self.session.rover, "/rover", self.session.arm_angles)
        self._forces = ForceArrows(scene, self.session.rover)

    def _draw_sliders(self) -> None:
        gui = self.server.gui
        self._slider_home.remove()
        with self._rover_tab:
            self._slider_home = gui.add_folder("Values", expand_by_default=True)
        with self._slider_home:
            self._sliders = RoverSliders(gui, self.session.rover, self._change_value)
            arm = self.session.rover.manipulator
            if arm is not None:
                with gui.add_folder("Arm", expand_by_default=False):
                    limits = arm.joint_limits or ((-3.15, 3.15),) * 3
                    for joint, (low, high), at in zip(arm.joints, limits, arm.stowed, strict=True):
                        self._add_arm_slider(joint, low, high, at)

    def _add_arm_slider(self, joint: str, low: float, high: float, at: float) -> None:
        slider = self.server.gui.add_slider(f"{joint} [rad]", low, high, 0.01, at)

        def turn(event: Any) -> None:
            with self._lock:
                if self.session.change_arm(joint, float(event.target.value)):
                    self._figure.turn_arm(self.session.rover, self.session.arm_angles)
                self._take_judgement()

        slider.on_update(turn)

    def _take_answer(self) -> None:
        """Show another answer: its paths and the chosen one's journey."""
        answer = self.session.answer
        names = ["best"]
        for k, candidate in enumerate(answer.candidates):
            word = "passable" if candidate.verdict.traversable else "refused"
            names.append(f"{k + 1}: {word}, {candidate.length:.2f} m")
        self._choice.options = tuple(names)
        self._take_judgement()

    def _take_judgement(self) -> None:
        """Show how the path is judged now."""
        session, shown = self.session, self.session.shown
        self.playback.restart(shown.journey.duration)
        self._charts.take(session.rover, shown.journey)
        self._paths.show(session.rover, session.terrain, session.answer, shown.candidate)
        verdict = describe_verdict(
            shown.verdict.traversable, shown.verdict.reason, session.refusal, shown.judged_in
        )
        self._verdict.content = self._note.content = verdict
        self._moved = True

    # What the controls do.

    def _click(self, event: Any) -> None:
        origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
        place = hit_ground(self.session.terrain, origin, direction)
        with self._lock:
            if place is None:
                self.session.refusal = "the click is beside the known ground"
            elif self._clicks == "goal":
                self.session.plan_to(place)
            else:
                self.session.plan_from(place)
            self.playback.jump(0.0)
            self._take_answer()

    def _change_value(self, value: RoverValue, number: float) -> None:
        with self._lock:
            if self.session.change_rover(value.keys, number):
                self._draw_rover()
                self._changed_at = time.monotonic()
            self._take_judgement()

    def _choose_path(self, event: Any) -> None:
        word = event.target.value.split(":")[0]
        with self._lock:
            answer = self.session.answer
            self.session.show_candidate(answer.nearest if word == "best" else int(word) - 1)
            self._take_judgement()

    def _set_options(self, **changes: object) -> None:
        with self._lock:
            self.session.take_options(**changes)
            self._take_answer()

    def _load(self, read: Any) -> None:
        with self._lock:
            try:
                taken = self.session.take_rover(read())
            except REFUSALS as error:
                self.session.refusal, taken = str(error), False
            if taken:
                self._take_all()
            else:
                self._take_judgement()

    def _send_rover(self, event: Any) -> None:
        rover = self.session.rover
        content = write_rover(rover).encode()
        event.client.send_file_download(f"{Path(rover.name).stem}.yaml", content)

    # What moves the page.

    def _run(self) -> None:
        last, board_at = time.monotonic(), 0.0
        while not self._ended.wait(FRAME):
            now = time.monotonic()
            with self._lock:
                if self._live is not None:
                    board_due = now - board_at > BOARD_FRAME
                    self._show_live(board_due)
                    board_at = now if board_due else board_at
                    continue
                self._moved |= self.playback.advance(now - last)
                last = now
                if self._changed_at is not None and now - self._changed_at > REST:
                    self._changed_at = None
                    self.session.plan_again()
                    self._take_answer()
                if self._moved:
                    board_due = now - board_at > BOARD_FRAME or self.playback.rate == 0.0
                    self._show_frame(board_due)
                    board_at = now if board_due else board_at
                    self._moved = False

    def _show_live(self, with_board: bool) -> None:
        """Show the latest that the listener heard."""
        assert self._live is not None
        state, terrain, plan, verdict = self._listener.latest()
        if terrain is not None and terrain is not self.session.terrain:
            self.session.terrain = terrain
            self._draw_ground()
        if self._told != (id(plan), verdict):
            self._told = (id(plan), verdict)
            self._paths.show_plan(self.session.rover, self.session.terrain, plan)
            passable = plan is not None
            self._verdict.content = describe_verdict(passable, verdict, "", None)
        frame = self._live.frame(state)
        self._figure.visible = frame is not None
        if frame is None:
            if with_board:
                self._board.content = '<div id="board">waiting for odometry</div>'
            return
        with self.server.atomic():
            self._figure.show(frame)
            self._forces.show(frame)
        if with_board:
            self._board.content = draw_board(self.session.rover, frame, "live")

    def _show_frame(self, with_board: bool) -> None:
        frame = self.session.shown.journey.frame(self.playback.time)
        self._figure.visible = frame is not None
        if frame is None:
            self._board.content = '<div id="board">the rover cannot stand at the start</div>'
            return
        with self.server.atomic():
            self._figure.show(frame)
            self._forces.show(frame)
        if with_board:
            self._board.content = draw_board(self.session.rover, frame, self.playback.describe())
            self._charts.show(frame.distance)
            duration = self.playback.duration
            self._player.show(100.0 * self.playback.time / duration if duration else 0.0)
