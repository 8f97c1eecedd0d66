# SPDX-License-Identifier: Apache-2.0
"""Rovers as URDF: there and back, in MuJoCo, and files of other conventions."""

import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest

from rover_physics import load_rover
from rover_physics.errors import RoverFileError
from rover_physics.names import WHEELS
from rover_physics.rover.rover_file import preset_names, rover_to_dict, save_rover, save_yaml
from rover_physics.rover.steering_joints import steered_wheels, steering_joints
from rover_physics.rover.uncertainty import Uncertainty
from rover_physics.rover.urdf.joint_map import load_joint_map, map_of
from rover_physics.rover.urdf.read_rover import Levelling, ReadRover, rover_from_urdf
from rover_physics.rover.urdf.robot import parse_robot
from rover_physics.rover.urdf.write_urdf import write_urdf
from support.project.checkout import TOP
from support.rover_geometry import place_rover
from support.rovers import LSR1

WHEEL = replace(LSR1.wheel, servo_droop=0.2, torque_per_current=0.7)
UNUSUAL = replace(LSR1, wheel=WHEEL, uncertainty=Uncertainty(mass=0.3))
"""A rover with values other than the usual ones, of which a URDF tells nothing."""


@pytest.mark.parametrize(
    "rover", [*map(load_rover, preset_names()), UNUSUAL], ids=[*preset_names(), "unusual"]
)
def test_a_rover_comes_back_from_its_urdf_and_joint_map_and_from_its_file(rover, tmp_path):
    write_urdf(tmp_path / "rover.urdf", rover)
    save_yaml(tmp_path / "joints.yaml", map_of(rover))
    read = rover_from_urdf(tmp_path / "rover.urdf", tmp_path / "joints.yaml")
    assert read.rover == rover
    assert read.asymmetry < 1e-9 and read.levelling == Levelling()
    save_rover(tmp_path / "rover.yaml", rover, "two\nlines")
    assert load_rover(str(tmp_path / "rover.yaml")) == rover


def foreign_urdf() -> str:
    """Return a URDF as CAD programs write: x forward, y right, z down, wheels on short axles."""

    def link(name: str, mass: float, geometry: str = "") -> str:
        inertial = f'<inertial><mass value="{mass}"/></inertial>'
        return f'<link name="{name}">{inertial}{geometry}</link>'

    def joint(name: str, kind: str, parent: str, child: str, xyz: str, axis: str) -> str:
        return (
            f'<joint name="{name}" type="{kind}"><origin xyz="{xyz}"/><parent link="{parent}"/>'
            f'<child link="{child}"/><axis xyz="{axis}"/>'
            '<limit lower="-0.4" upper="0.5" effort="3" velocity="2"/></joint>'
        )

    text = '<robot name="foreign">' + link("World", 0.0) + link("Body", 10.0)
    text += '<joint name="Root" type="floating"><parent link="World"/><child link="Body"/></joint>'
    for side, y in (("R", 1.0), ("L", -1.0)):
        rocker, bogie = f"Rocker{side}", f"Bogie{side}"
        tread = (
            f'<collision><origin xyz="0 {0.05 * y} 0" rpy="1.5707963267948966 0 0"/>'
            '<geometry><cylinder radius="0.1" length="0.06"/></geometry></collision>'
        )
        text += link(rocker, 2.0) + link(bogie, 1.0)
        text += joint(f"P{side}", "revolute", "Body", rocker, f"0.1 {0.3 * y} -0.5", "0 1 0")
        text += joint(f"Q{side}", "revolute", rocker, bogie, "0.2 0 0.05", "0 -1 0")
        for name, parent, place in (
            (f"B{side}", rocker, "-0.4 0 0.2"),
            (f"M{side}", bogie, "-0.2 0 0.15"),
            (f"F{side}", bogie, "0.2 0 0.15"),
        ):
            text += link(f"Wheel{name}", 0.5, tread)
            text += joint(f"W{name}", "continuous", parent, f"Wheel{name}", place, "0 1 0")
    return text + "</robot>"


FOREIGN_MAP: dict[str, Any] = {
    "axes": {"forward": "x", "up": "-z"},
    "rocker": {"right": "PR", "left": "PL"},
    "bogie": {"right": "QR", "left": "QL"},
    "wheels": dict(zip(WHEELS, ("WBR", "WMR", "WFR", "WBL", "WML", "WFL"), strict=True)),
    "rover": {
        "gravity": 9.81,
        "friction": 0.7,
        "nominal_speed": 0.05,
        "belly": {"z": -0.05, "x": [-0.2, 0.2], "y": [-0.2, 0.2]},
        "limits": rover_to_dict(load_rover("lsr1"))["limits"],
    },
}


def read_foreign(folder: Path, text: str = "", **keys: Any) -> ReadRover:
    """Read the foreign rover with keys of its map changed; None leaves a key out."""
    (folder / "foreign.urdf").write_text(text or foreign_urdf())
    contents = {k: v for k, v in (FOREIGN_MAP | keys).items() if v is not None}
    save_yaml(folder / "foreign.yaml", contents)
    return rover_from_urdf(folder / "foreign.urdf", folder / "foreign.yaml")


def turned(text: str, place: str, angle: float) -> str:
    """Return a URDF with the joints at a place turned about y."""
    origin = f'<origin xyz="{place}"'
    assert f"{origin}/>" in text
    return text.replace(f"{origin}/>", f'{origin} rpy="0 {angle} 0"/>')


def test_a_urdf_of_another_convention_is_turned_into_the_body_frame(tmp_path):
    rover = read_foreign(tmp_path).rover
    suspension, masses = rover.suspension, rover.masses
    assert suspension.rocker_pivot == pytest.approx((0.0, 0.3, 0.0))
    assert suspension.bogie_pivot == pytest.approx((0.2, 0.3, -0.05))
    assert suspension.rocker_wheel == "rear"
    assert suspension.wheels["rear"] == pytest.approx((-0.4, 0.35, -0.2))
    assert suspension.wheels["front"] == pytest.approx((0.4, 0.35, -0.2))
    # The rocker's axis is y of the file, which is -y of the body; the bogie's is +y.
    assert suspension.rocker_limits == pytest.approx((-0.5, 0.4))
    assert suspension.bogie_limits == pytest.approx((-0.4, 0.5))
    assert (rover.wheel.radius, rover.wheel.width) == (0.1, 0.06)
    assert (rover.wheel.max_torque, rover.wheel.max_speed) == (3.0, 2.0)
    # Masses add up and keep their first moments.
    assert rover.total_mass == pytest.approx(10.0 + 2 * 2.0 + 2 * 1.0 + 6 * 0.5)
    assert masses.body.mass == pytest.approx(10.0)
    assert masses.body.com == pytest.approx((-0.1, 0.0, -0.5))
    # The file has a wheel's mass on its axle, the model in the middle of its tread.
    assert masses.rocker.com == pytest.approx((0.0, 0.3 - 0.5 * 0.05 / 2.0, 0.0))


def test_a_wheel_is_its_largest_cylinder(tmp_path):
    hub = '<geometry><cylinder radius="0.03" length="0.2"/></geometry></collision><collision>'
    text = foreign_urdf().replace("<collision>", f"<collision>{hub}")
    assert read_foreign(tmp_path, text).rover == read_foreign(tmp_path).rover


def test_what_rounding_leaves_of_a_bogie_without_mass_is_no_mass(tmp_path):
    text = re.sub(r'("Bogie."><inertial><mass value=)"1.0"', r'\1"0"', foreign_urdf())
    text = text.replace('mass value="0.5"', 'mass value="0.1"')
    for wheel in ("BR", "MR", "FR", "BL", "ML", "FL"):
        motor = f'<link name="A{wheel}"><inertial><mass value="0.7"/></inertial></link>'
        motor += f'<joint name="A{wheel}" type="fixed"><parent link="Wheel{wheel}"/>'
        text = text.replace("</robot>", f'{motor}<child link="A{wheel}"/></joint></robot>')
    bogie = read_foreign(tmp_path, text).rover.masses.bogie
    assert (bogie.mass, bogie.com) == (0.0, pytest.approx((0.2, 0.3, -0.05)))


def test_angles_of_the_map_bring_the_rover_onto_flat_ground(tmp_path):
    straight = read_foreign(tmp_path).rover
    text = turned(turned(foreign_urdf(), "0.1 0.3 -0.5", 0.1), "0.1 -0.3 -0.5", 0.1)
    again = read_foreign(tmp_path, text, angles={"PR": -0.1, "PL": -0.1}).rover
    assert again == replace(straight, suspension=again.suspension)
    assert again.suspension.wheels["rear"] == pytest.approx(straight.suspension.wheels["rear"])
    assert again.suspension.rocker_limits == pytest.approx((-0.6, 0.3))


def test_wheels_that_are_not_level_are_brought_onto_level_ground(tmp_path):
    nose_down, turn = -0.02, 0.015
    straight = read_foreign(tmp_path).rover
    # The file has y to the right, so its pitch is positive with the nose up.
    text = turned(foreign_urdf(), "0.2 0 0.05", turn)
    for place in ("0.1 0.3 -0.5", "0.1 -0.3 -0.5"):
        text = turned(text, place, nose_down)
    read = read_foreign(tmp_path, text)
    suspension = read.rover.suspension
    # The rockers are turned back by the pitch of the body, the bogies by their own angle.
    assert read.levelling.pitch == pytest.approx(nose_down, abs=1e-11)
    assert read.levelling.bogie == pytest.approx(turn, abs=1e-11)
    for wheel, place in straight.suspension.wheels.items():
        assert suspension.wheels[wheel] == pytest.approx(place, abs=1e-11)
    assert suspension.bogie_limits == pytest.approx((-0.4 - turn, 0.5 - turn), abs=1e-6)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"rocker": {"right": "PR", "left": "PX"}}, "no joint 'PX' .*moving joints are PR, QR"),
        ({"rocker": {"right": "PL", "left": "PR"}}, "does not hang on Rocker"),
        ({"axes": {"forward": "x", "up": "z"}}, "rocker.right: y is .* on the other side"),
        ({"axes": {"forward": "x", "up": "-x"}}, "axes.up is -x; it must be across forward x"),
        ({"angles": {"PR": 0.05}}, "both sides of the rover must be alike"),
        ({"rover": {}}, "missing keys .* the URDF does not tell it: write it under rover: in"),
        ({"steering": {"rear_right": "WBR"}}, "steering.rear_right: joint WBR is named twice"),
        (
            {
                "steering": {"rear_right": "QR"},
                "bogie": {"right": "WMR", "left": "QL"},
                "wheels": FOREIGN_MAP["wheels"] | {"middle_right": "WFR", "front_right": "Root"},
            },
            "wheels.front_right: joint Root is floating; it must turn",
        ),
        (
            {"arm": {"joints": ["PR", "QR", "PL"], "tip": "t", "stowed": [0.0, 0.0, 0.0]}},
            "arm.tip: no link 't' in the URDF",
        ),
    ],
)
def test_a_wrong_joint_map_is_refused_with_its_key(keys, said, tmp_path):
    with pytest.raises(RoverFileError, match=said):
        read_foreign(tmp_path, **keys)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("<robot ", "<model ", "XML"),
        ('<robot name="foreign">', '<!DOCTYPE r><robot name="foreign">', "document type"),
        (
            '<robot name="foreign">',
            '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include/>',
            "expand it first",
        ),
        ('xyz="0.1 0.3 -0.5"', 'xyz="0.1 0.3"', "PR: xyz is '0.1 0.3'; it must be 3 numbers"),
        ('mass value="10.0"', 'mass value="-1"', "link Body: mass is -1"),
        ('mass value="10.0"', 'mass value="nan"', "Body: value is 'nan'; it must be a number"),
        ('xyz="0.1 0.3 -0.5"', 'xyz="1e300 0.3 -0.5"', "PR: xyz is '1e300 0.3 -0.5'"),
        ('type="floating"', 'type="hinge"', "joint Root: type is 'hinge'"),
        ('<child link="RockerL"/>', '<child link="RockerX"/>', "'RockerX' is no link"),
        ('<child link="RockerL"/>', '<child link="RockerR"/>', "RockerR hangs on two joints"),
        ('<parent link="World"/>', '<parent link="RockerR"/>', "link Body hangs on itself"),
        ('<link name="RockerL">', '<link name="RockerR">', "two <link> of the same name"),
        ('xyz="0.1 -0.3 -0.5"', 'xyz="0.15 -0.3 -0.5"', "suspension.rocker_pivot: left .* apart"),
        (
            '<link name="RockerL"><inertial>',
            '<link name="RockerL"><inertial><origin xyz="0 9 0"/>',
            "masses.rocker.com: left .* m apart; both sides",
        ),
    ],
)
def test_a_wrong_urdf_is_refused_with_what_is_wrong(old, new, said, tmp_path):
    text = foreign_urdf()
    assert old in text
    with pytest.raises(RoverFileError, match=said):
        read_foreign(tmp_path, text.replace(old, new, 1))


def insert_link(text: str, joint: str, axis: str = "0 1 0") -> str:
    """Return a URDF with a link between a joint's parent and the joint, on a pivot of its own."""
    before, after = text.split(f'<joint name="{joint}" ')
    own, after = after.split("</joint>", 1)
    parent = re.search('<parent link="(.*?)"/>', own)[1]
    own = own.replace(f'<parent link="{parent}"/>', f'<parent link="On{joint}"/>')
    return (
        f'{before}<link name="On{joint}"/><joint name="To{joint}" type="revolute">'
        f'<parent link="{parent}"/><child link="On{joint}"/><axis xyz="{axis}"/></joint>'
        f'<joint name="{joint}" {own}</joint>{after}'
    )


@pytest.mark.parametrize(
    ("joint", "said"),
    [
        ("WM", "wheels.middle_.*: it hangs on joint ToWM., which is"),
        ("Q", "wheels.middle_.*: it hangs on joint ToQ., which is"),
        ("WB", "wheels.rear_.*: its link .* name those under fixed"),
    ],
)
def test_what_moves_between_a_rocker_and_its_wheels_is_refused_unless_it_is_named_as_fixed(
    joint, said, tmp_path
):
    """A second lambda between bogie and wheels was frozen in silence.

    As in models of Curiosity: the arm to the bogie, or that to the lone wheel, has a joint.
    """
    straight, text = read_foreign(tmp_path).rover, foreign_urdf()
    for side, y in (("R", 0.3), ("L", -0.3)):
        text = insert_link(text, f"{joint}{side}")
        if joint == "WB":  # what carries the lone wheel hangs on the body, where the rocker does
            at = f'<parent link="Rocker{side}"/><child link="OnWB{side}"/>'
            assert at in text
            text = text.replace(
                at, f'<origin xyz="0.1 {y} -0.5"/>{at.replace("Rocker" + side, "Body")}'
            )
    with pytest.raises(RoverFileError, match=said):
        read_foreign(tmp_path, text)
    fixed = [f"To{joint}{side}" for side in "RL"]
    assert read_foreign(tmp_path, text, fixed=fixed).rover == straight


def tilted(text: str, slope: float) -> str:
    """Return the foreign rover with pivots of its rockers that rise outwards by a slope."""
    for side, rise in (("R", -slope), ("L", slope)):  # z points down
        before, after = text.split(f'<joint name="P{side}"')
        text = f'{before}<joint name="P{side}"{after.replace("0 1 0", f"0 1 {rise}", 1)}'
    return text


def test_pivots_of_rockers_that_rise_outwards_are_taken_as_level_and_told(tmp_path):
    """As in models of Curiosity, by 0.2 rad."""
    read = read_foreign(tmp_path, tilted(foreign_urdf(), 0.2))
    assert read.rover == read_foreign(tmp_path).rover
    assert read.tilt == pytest.approx(math.atan(0.2))
    with pytest.raises(RoverFileError, match=r"rocker.right: joint PR turns about \[0.0, -0.9"):
        read_foreign(tmp_path, tilted(foreign_urdf(), 0.4))


@pytest.mark.parametrize("kind", ["rocker", "bogie"])
def test_a_rover_of_three_bogies_is_refused_by_name(kind, tmp_path):
    """The one across the rover is on both sides, whatever it was thought to be."""
    text = insert_link(foreign_urdf(), "Root", "1 0 0")
    with pytest.raises(RoverFileError, match="a rover of three bogies has neither"):
        read_foreign(tmp_path, text, **{kind: {"right": "ToRoot", "left": "ToRoot"}})


def test_the_joint_map_of_perseverance_has_the_masses_of_the_preset():
    found = load_joint_map(TOP / "examples" / "rover" / "perseverance_joints.yaml")
    assert found.rover["masses"] == rover_to_dict(load_rover("m2020"))["masses"]


def test_a_file_of_many_links_is_refused_at_once():
    text = "".join(f'<link name="l{k}"/>' for k in range(5000))
    with pytest.raises(RoverFileError, match="has 5000 <link>; at most 2000 are read"):
        parse_robot(f"<robot>{text}</robot>".encode())


def test_limits_that_no_joint_reaches_count_as_none():
    limits = 'lower="-0.4" upper="0.5" effort="3" velocity="2"'
    none = 'lower="-1.79769e+308" upper="1.79769e+308" effort="0" velocity="1e+300"'
    joint = parse_robot(foreign_urdf().replace(limits, none).encode()).joints["PR"]
    assert (joint.lower, joint.upper) == (-math.inf, math.inf)
    assert (joint.effort, joint.velocity) == (math.inf, math.inf)


ROCKER, BOGIES, TURN = 0.2, np.array([0.3, -0.25]), 0.4
"""Angles of the right rocker, of both bogies and of the steered wheels [rad]."""


@pytest.mark.parametrize("name", ["lsr1", "m2020"])
def test_mujoco_has_masses_and_wheels_of_the_urdf_where_the_model_has_them(name, tmp_path):
    rover, urdf = load_rover(name), tmp_path / "rover.urdf"
    write_urdf(urdf, rover)
    spec = mujoco.MjSpec.from_file(str(urdf))
    spec.body("base_link").add_freejoint()
    ((mimic,), model) = spec.equalities, spec.compile()
    assert {mimic.name1, mimic.name2} == {"rocker_right", "rocker_left"}
    assert mimic.data[:2].tolist() == [0.0, -1.0]  # one side goes up as the other goes down
    assert model.body_mass.sum() == pytest.approx(rover.total_mass)
    data, steering = mujoco.MjData(model), np.zeros((1, 6))
    angles = {"rocker_right": ROCKER, "rocker_left": -ROCKER}
    angles |= dict(zip(("bogie_right", "bogie_left"), BOGIES, strict=True))
    if rover.manipulator is not None:
        angles |= dict(zip(rover.manipulator.joints, rover.manipulator.stowed, strict=True))
    angles |= dict.fromkeys(steering_joints(rover), TURN)
    steering[0, steered_wheels(rover)] = TURN
    for joint, angle in angles.items():
        data.joint(joint).qpos = angle
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    posed = SimpleNamespace(
        rocker_angle=np.array([[ROCKER, -ROCKER]]), bogie_angle=BOGIES[None],
        steering_angle=steering, roll=[0.0], pitch=[0.0], poses=np.zeros((1, 3)),
        position=np.zeros((1, 3)),
    )  # fmt: skip
    placed, bodies = place_rover(rover, posed, 0), [data.body(wheel) for wheel in WHEELS]
    masses, places, *_ = zip(*placed.masses, strict=True)
    com = np.average(places, axis=0, weights=masses)
    np.testing.assert_allclose(data.subtree_com[0], com, atol=1e-9)
    centres = np.array([body.xpos for body in bodies])
    np.testing.assert_allclose(centres, placed.wheels, atol=1e-9)
    axes = np.array([body.xmat.reshape(3, 3)[:, 1] for body in bodies])
    np.testing.assert_allclose(axes, placed.axles, atol=1e-9)
