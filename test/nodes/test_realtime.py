# SPDX-License-Identifier: Apache-2.0
"""Precedence over other programs: taken by all threads, or refused with what would be right."""

import subprocess
import sys

from rover_planner.ros.process import take_priority

PROGRAM = """
import os, threading
from rover_planner.ros.process import init_ros
from rover_planner.ros.process import take_priority
init_ros([])
threading.Thread(target=threading.Event().wait, daemon=True).start()
print(take_priority(3))
names = os.listdir("/proc/self/task")
print({os.sched_getscheduler(int(name)) == os.SCHED_FIFO for name in names})
print([line for line in open("/proc/self/status") if line.startswith("THP_enabled")])
"""


def test_all_threads_take_it_or_the_reason_is_told_and_memory_is_not_collected_into_huge_pages():
    ran = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=60, check=True
    )
    reason, policies, pages = ran.stdout.splitlines()
    assert policies == "{True}" if reason == "" else "CAP_SYS_NICE" in reason
    assert "THP_enabled:\\t0" in pages


def test_zero_asks_for_nothing_and_what_no_system_grants_is_told():
    assert take_priority(0) == ""
    assert "realtime_priority 1000" in take_priority(1000)
