# SPDX-License-Identifier: Apache-2.0
"""The page that plans: what visitors ask of the session, and one function that shows its state."""

import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from functools import cached_property, partial
from typing import Any

from rover_physics.numerics.arrays import Floats
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover, preset_names, rover_to_dict
from rover_physics.terrain.soil_file import load_soils
from rover_planner.advice.advise import Advice, grow_advice
from rover_planner.advice.case import case_of
from rover_planner.advice.seek import Remedy
from rover_planner.errors import PlanningError
from rover_planner.studies.rover_values import read_rover, write_rover
from rover_planner.viewer.documents import advice, paths
from rover_planner.viewer.pages import sharing
from rover_planner.viewer.pages.base import HERE, PERIOD, TELLING, Answer, PageBase
from rover_planner.viewer.scene.ground_mesh import paint
from rover_planner.viewer.scene.overlays import GHOST
from rover_planner.viewer.scene.scene import FIT
from rover_planner.viewer.state.drive import SPEEDS, Playback
from rover_planner.viewer.state.judging import Step
from rover_planner.viewer.state.layers import PREDICTED, Colouring, ShownSurvey
from rover_planner.viewer.state.scenario import Scenario, Shown
from rover_planner.viewer.state.session import ViewSession

NOTICE_DELAY = 0.2
"""Time without a result after which the page tells what it judges, and greys what is old [s]."""
BOARD_PERIOD = 0.1
"""Time between two updates of board and lanes while it plays [s]."""


class Page(PageBase):
    """Shows what the session judges in the background, and plays the path that is looked at.

    The page's own thread asks for judgements and takes them; it waits for none.
    """

    def __init__(
        self,
        session: ViewSession,
        address: tuple[str, int] = HERE,
        survey: ShownSurvey | None = None,
        ground_name: str = "ground",
    ):
        """Start to serve a session; other arguments as for `PageBase`."""
        self.session, self.playback = session, Playback(session.shown.path.trajectory)
        self._click_sets = "goal"
        self._opening: tuple[sharing.PageLink, Scenario] | None = None
        """The link whose path and time are not shown yet, and what it asks for."""
        self._told_at = 0.0
        asked = session.wanted
        super().__init__(asked.rover, asked.terrain, address, ground_name, survey)
        self._advice = self.begin_work(self._take_advice, "advice")
        self._judging = self.begin_work(self._take_judged, "judge")
        session.judge = self._judging.ask
        self._sought_at: float | None = None
        """When advice on the path that is looked at was asked for, on the monotonic clock [s]."""
        self._advised: Advice | None = None
        """What was found."""
        self._offers = {
            "presets": list(preset_names()),
            "soils": list(load_soils()),
            "policies": [[name, title] for name, title in paths.POLICY_TITLES.items()],
            "speeds": list(SPEEDS),
        }
        self.has_changed("the cameras are not moved", session.wanted.loaded)  # START is theirs
        self._show()
        self.paint()
        session.ask()  # with the search that was not made
        self.thread.start()

    def paint(self) -> None:
        """Begin to colour the ground with what is shown on it."""
        shown = self.session.shown
        site, path = shown.scenario.site, shown.path.poses
        self.painter.ask(paint(site, self.colouring, path, self.survey))

    # What visitors ask.

    def list_answers(self) -> Mapping[str, Answer]:
        """Return what the page does by the word `ask`."""
        session, playback = self.session, self.playback

        def change(**options: Any) -> None:
            session.take_change(session.wanted.change_options(**options))

        return {
            "show": lambda words: session.show_path(int(words["index"])),
            "value": lambda words: self._change_value(words["label"], float(words["value"])),
            "policy": lambda words: change(policy=words["name"]),
            "soil": lambda words: change(soil=words["name"] or None),
            "undo": lambda _words: session.undo(),
            "reset": lambda _words: session.take_change(session.wanted.as_loaded()),
            "keep": lambda _words: session.keep_reference(session.shown.scenario),
            "drop": lambda _words: session.keep_reference(None),
            "cancel": lambda _words: self._cancel(),
            "judge": lambda _words: session.ask(),
            "preset": lambda words: session.take_rover(load_rover(words["name"])),
            "upload": lambda words: session.take_rover(read_rover(words["text"], words["name"])),
            "open": lambda words: self._open(sharing.read_link(words["query"])),
            "click": lambda words: setattr(self, "_click_sets", words["sets"]),
            "toggle": lambda _words: playback.toggle(),
            "step": lambda words: playback.step(words["by"]),
            "seek": lambda words: playback.go_to(float(words["time"])),
            "place": lambda words: playback.go_to(playback.drive.time_at(words["distance"])),
            "speed": lambda words: setattr(playback, "speed", float(words["times"])),
            "failure": lambda _words: self._go_to_failure(),
            "advise": lambda _words: self._seek_advice(),
            "ghost": lambda words: self._show_ghost(words["words"]),
            "remedy": lambda words: self._take_remedy(words["words"]),
            "save rover": lambda _words: _write_rover(session.wanted.rover),
            "save page": lambda words: self._save_page(str(words.get("base", ""))),
            "link": lambda _words: self._tell_link(),
        }

    def click(self, point: Floats, shift: bool) -> None:
        """Set goal or start, and plan."""
        if shift or self._click_sets == "start":
            self.session.plan_to(self.session.wanted.goal, point)
        else:
            self.session.plan_to(point)

    def show_refusal(self, reason: str) -> None:
        """Show why a request was refused."""
        self.session.refusal = reason

    def _change_value(self, label: str, number: float) -> None:
        """Change a number of the rover, or turn a joint, by the label of its slider."""
        session = self.session
        parts = paths.list_sliders(session.wanted.loaded).values()
        found = [one for values in parts for one in values if one.label == label]
        if not found:
            raise PlanningError(f"the rover has no number {label!r}")
        (one,) = found
        kind, name, *_ = (*one.keys[0], "")
        if kind == paths.JOINTS:
            angles = {**session.wanted.arm, str(name): number}
            session.take_change(session.wanted.change_options(joint_angles=angles))
        else:
            session.change_rover(one.keys, number)

    def _cancel(self) -> None:
        self.session.is_stopped |= self._judging.cancel()
        for work in self.works:
            work.cancel()

    def _go_to_failure(self) -> None:
        failure = self.session.shown.path.failure
        if failure is not None:
            self.playback.go_to(failure.state.time)
            self.scene.look_at_failure(failure)

    # Advice.

    def _seek_advice(self) -> None:
        path = self.session.shown.path
        self._sought_at, self._advised = time.monotonic(), None
        self._advice.ask(grow_advice(case_of(path.scenario.site, path.poses)))

    def _take_advice(self, _steps: Any, found: Advice | BaseException) -> None:
        if isinstance(found, BaseException):
            self._sought_at = None
            raise PlanningError(f"no advice: {found}")
        if self._sought_at is not None:  # and nobody looks at another path meanwhile
            self._advised = found

    def _find_remedy(self, words: str | None) -> Remedy | None:
        remedies = advice.list_remedies(self._advised)
        return next((one for one in remedies if one.describe() == words), None)

    def _show_ghost(self, words: str | None) -> None:
        """Show where the path of a remedy leads while a person points at it; None ends that.

        A browser may still list the remedies of an earlier path: of those none is shown.
        """
        remedy = self._find_remedy(words)
        path = None if remedy is None else remedy.judged.case.poses
        self.scene.paths.show_line("ghost", path, GHOST)

    def _take_remedy(self, words: str) -> None:
        """Judge the path with the levers of a remedy set."""
        remedy = self._find_remedy(words)
        if remedy is None:
            raise PlanningError(f"{words!r} is no remedy of the path that is shown")
        self._show_ghost(None)
        self.session.take_change(advice.apply_remedy(self.session.wanted, remedy))

    # Files and links.

    @cached_property
    def _map_print(self) -> str:
        """The fingerprint of the map, computed when it is first asked for."""
        return self.ground.fingerprint

    def _link(self) -> sharing.PageLink:
        """Return the link to what is shown."""
        shown, now = self.session.shown, self.session.shown.scenario
        return sharing.PageLink(
            loaded=rover_to_dict(now.loaded),
            rover=rover_to_dict(now.rover),
            ground=self._map_print,
            start=now.start,
            goal=now.goal,
            policy=now.options.model.policy,
            soil=now.options.model.soil or "",
            path=shown.index + 1,
            time=round(self.playback.time, 3),
            joints=now.options.model.arm_angles or {},
            **asdict(self.colouring),
        )

    def _tell_link(self) -> dict[str, Any]:
        """Return the link to what is shown, for the visitor who asks for it."""
        query, name = sharing.write_link(self._link()), self.session.shown.scenario.rover.name
        if not query:
            raise PlanningError(
                f"the link with the file of {name} would be longer than an address may be, "
                f"{sharing.MAX_LENGTH} characters; save the rover file and the HTML file instead"
            )
        return {"link": query}

    def _save_page(self, base: str) -> dict[str, Any]:
        """Return the page as a file; the rover goes to where the path is refused if it is."""
        path = self.session.shown.path
        if path.failure is not None:
            self.playback.go_to(path.failure.state.time)
        self.advance(0.0)
        self.tell()
        model = path.scenario.rover
        text = sharing.write_file(self.server, self.channel.parts, self._link(), model, base)
        return {"file": {"name": f"{model.name}.html", "text": text}}

    def _open(self, link: sharing.PageLink | None) -> None:
        """Judge what a link holds, and show it."""
        if link is None:
            return
        if link.layer not in self.layers:
            raise PlanningError(f"the link names the layer {link.layer!r}, which there is not")
        asked = sharing.read_scenario(link, self.session.wanted, self._map_print)
        self.colouring = Colouring(link.layer, link.heading, link.along)
        self.session.take_scenario(asked)
        self._opening = link, asked
        self.paint()

    def _go_on_opening(self) -> None:
        """Show path and time of the link that was opened, as soon as they are judged."""
        if self._opening is None:
            return
        (link, asked), session = self._opening, self.session
        if session.wanted is not asked:
            self._opening = None
        elif session.is_outdated:
            return
        elif session.shown.index == link.path - 1:
            self._opening = None
            self.playback.go_to(link.time)
        elif link.path <= len(session.shown.paths):
            session.show_path(link.path - 1)
        elif self._judging.progress is None:  # no path around was found this time
            self._opening = None

    # What was judged.

    def _take_judged(self, steps: Iterator[Step], found: Shown | BaseException) -> None:
        self.run("not judged", partial(self.session.take, steps, found))
        self._show()
        self._go_on_opening()

    def _show(self) -> None:
        """Show what was judged: in words and numbers at once, then in the scene.

        A new verdict has a period for itself: without a graphics card, the browser takes longer
        for a picture of the scene, and words that come with it wait for that.
        """
        shown, scene, draw = self.session.shown, self.scene, self.draw_made
        asked, path = shown.scenario, shown.path
        if self.has_changed("advice", path):
            self._advice.cancel()  # nobody looks at its path any more
            self._advised = self._sought_at = None
            self._show_ghost(None)
        self.run(TELLING, self.tell)
        if self.has_changed("ends", asked.start, asked.goal):
            self.playback.go_to(0.0)
        is_new = self.has_changed("drive", path)
        if is_new:
            self.playback.drive = path.trajectory
        self._tell_drive()
        if is_new:
            self._ended.wait(PERIOD)
        draw("the failure is not shown", scene.mark_failure, path.failure)
        draw("the rover is not drawn", scene.rover.take, asked.rover, asked.arm)
        scene.path_places = path.poses[:, :2]
        draw("the cameras are not moved", lambda _: scene.look(FIT), asked.loaded)
        draw("the paths are not drawn", scene.paths.show, shown.paths, shown.index)
        depends = self.colouring.layer in PREDICTED or self.survey is not None
        if self.has_changed("ground", asked) and depends:
            self.paint()
        self.playback.moved = True

    # What is told.

    def _find_work(self) -> dict[str, Any]:
        """Return what is worked on, and why the verdict is an old one meanwhile; else empty."""
        session, judging, old = self.session, "", ""
        progress = self._judging.progress
        shown = progress or self.painter.progress
        if shown is not None and shown.seconds > NOTICE_DELAY:
            judging = f"{shown.describe()} ... {int(shown.seconds)} s"
            old = f"judging {progress.describe()}" if progress is not None else ""
        elif session.is_stopped:
            old = "the judgement was stopped"
        return {
            "judging": judging,
            "stopped": session.is_stopped,
            "old": old if session.is_outdated else "",
            "refusal": session.refusal,
        }

    def tell(self) -> None:
        """Tell all that is shown, as far as it has changed."""
        session, tell, made = self.session, self.channel.tell, self.tell_made
        shown, wanted, work = session.shown, session.wanted, self._find_work()
        path, reference = shown.path, shown.reference
        every = frozenset(range(len(shown.paths)))
        is_slow = work["judging"] or work["stopped"]
        self.scene.paths.mark_old(every if work["old"] else shown.old if is_slow else frozenset())
        made("subject", paths.describe_subject, shown.scenario, self.ground_name)
        tell("verdict", paths.describe_verdict(shown) | work)
        is_judging, is_seeking = (
            one.progress is not None for one in (self._judging, self._advice)
        )
        made("paths", paths.describe_paths, shown, bool(work["old"]), is_judging)
        now = time.monotonic()
        helps = advice.describe_advice(self._advised, self._sought_at, is_seeking, now)
        tell("advice", None if shown.verdict.traversable else helps)
        made("current", lambda *_: sharing.write_link(self._link()), shown, self.colouring)
        made("sliders", lambda _: paths.describe_sliders(wanted), wanted.loaded)
        made("values", paths.read_values, wanted)
        made("changes", paths.describe_changes, path, reference, session.kept is not None)
        made("limits", paths.describe_limits, path, reference, shown.chance)
        model = wanted.options.model
        tell("chosen", {
            **self.list_chosen(), **self._offers, "policy": model.policy, "soil": model.soil or "",
            "sets": self._click_sets, "speed": self.playback.speed, "preset": wanted.loaded.name,
        })  # fmt: skip

    def advance(self, seconds: float) -> None:
        """Play on by a time of the visitor [s], and show what has changed."""
        playback = self.playback
        playback.advance(seconds)
        if not playback.moved:
            return
        path = self.session.shown.path
        self.scene.show(path.state_at(playback.time), path.failure)
        now = time.monotonic()
        playback.moved = now - self._told_at < BOARD_PERIOD and playback.is_playing
        if not playback.moved:
            self._told_at = now
            self._tell_drive()

    def _tell_drive(self) -> None:
        path, playback = self.session.shown.path, self.playback
        state, failure = path.state_at(playback.time), path.failure
        plays = f"playing, {playback.speed:g} times as fast as the rover"
        self.channel.tell("drive", {
            "time": round(playback.time, 2), "duration": round(playback.duration, 2),
            "distance": 0.0 if state is None else round(state.distance, 4),
            "plays": playback.is_playing, "words": plays if playback.is_playing else "paused",
            "fails": None if failure is None else round(float(failure.state.time), 2),
        })  # fmt: skip
        link = "" if failure is None else failure.link
        board = paths.describe_board(state, link)
        self.channel.tell("board", board)
        uses = paths.describe_uses(path, playback.time, self.session.shown.chance)
        self.channel.tell("uses", uses)


def _write_rover(model: Rover) -> dict[str, Any]:
    name = f"{model.name.removesuffix('.yaml')}.yaml"
    return {"file": {"name": name, "text": write_rover(model)}}
