"""Precedence over other programs: taken by all threads, or refused with what would be right."""

import subprocess
import sys

from rover_planner.ros.realtime import take_priority

ASK = """
import os, threading
from rover_planner.ros.realtime import take_priority
end = threading.Event()
threading.Thread(target=end.wait, daemon=True).start()
print(take_priority(3))
names = os.listdir("/proc/self/task")
print({os.sched_getscheduler(int(name)) == os.SCHED_FIFO for name in names})
"""

PAGES = """
from rover_planner.ros.disk import init_ros
init_ros([])
print([line for line in open("/proc/self/status") if line.startswith("THP_enabled")])
"""


def test_all_threads_take_it_or_the_reason_is_told():
    run = subprocess.run(
        [sys.executable, "-c", ASK], capture_output=True, text=True, timeout=60, check=True
    )
    reason, policies = run.stdout.splitlines()
    assert policies == "{True}" if reason == "" else "CAP_SYS_NICE" in reason


def test_what_no_system_grants_is_told():
    assert "realtime_priority 1000" in take_priority(1000)


def test_the_kernel_does_not_collect_the_memory_of_a_node_into_huge_pages():
    run = subprocess.run(
        [sys.executable, "-c", PAGES], capture_output=True, text=True, timeout=60, check=True
    )
    assert "THP_enabled:\\t0" in run.stdout
