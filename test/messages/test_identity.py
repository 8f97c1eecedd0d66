"""A path's hash is that of its frame and poses, as documented, and of nothing else."""

import hashlib
import struct

from builtin_interfaces.msg import Time

from msg_adapters.identity import path_hash, plan_request_hash
from msg_adapters.paths import poses_path, stamped_pose

POSES = [(0.0, 0.0, 0.0), (1.0, 0.5, 0.3)]


def seven(pose):
    p, q = pose.position, pose.orientation
    return struct.pack("<7d", p.x, p.y, p.z, q.x, q.y, q.z, q.w)


def test_the_hash_is_the_documented_one():
    path = poses_path(POSES, "map")
    data = b"map\0" + b"".join(seven(stamped.pose) for stamped in path.poses)
    assert path_hash(path) == hashlib.sha256(data).hexdigest()[:16]
    start, goal = (stamped_pose(pose, "map") for pose in POSES)
    data = b"map\0map\0" + seven(start.pose) + seven(goal.pose)
    data += struct.pack("<d", struct.unpack("<f", struct.pack("<f", 0.1))[0])
    assert plan_request_hash(start, goal, 0.1) == hashlib.sha256(data).hexdigest()[:16]


def test_stamps_do_not_count_and_poses_order_and_frame_do():
    path = poses_path(POSES, "map")
    assert path_hash(poses_path(POSES, "map", Time(sec=5))) == path_hash(path)
    others = [
        poses_path(POSES[::-1], "map"),
        poses_path(POSES[:1], "map"),
        poses_path([POSES[0], (1.0, 0.5, 0.3 + 1e-12)], "map"),
        poses_path(POSES, "odom"),
        poses_path([], "map"),
    ]
    assert len({path_hash(other) for other in [path, *others]}) == 1 + len(others)


def test_a_float_from_the_wire_and_a_python_number_give_one_hash():
    start, goal = (stamped_pose(pose, "map") for pose in POSES)
    on_wire = struct.unpack("<f", struct.pack("<f", 0.3))[0]
    assert plan_request_hash(start, goal, 0.3) == plan_request_hash(start, goal, on_wire)
