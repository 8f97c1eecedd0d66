# SPDX-License-Identifier: Apache-2.0
"""A system clock that is stepped for some processes alone, by a library that they load first.

What reads the system clock reads the stepped one, and deadlines on the system clock, by which
Fast DDS waits, are on it too. All else stays: libfaketime lets sleeps of Python fail and answers
of services get lost, which no step of a clock does.
"""

import os
import struct
import subprocess
from collections.abc import Mapping
from pathlib import Path

_SOURCE = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>

static const long none;
static volatile const long *ahead = &none;  /* s */

__attribute__((constructor)) static void open_file(void) {
  ahead = mmap(0, sizeof *ahead, PROT_READ, MAP_SHARED, open(getenv("CLOCK_AHEAD"), O_RDONLY), 0);
}

int clock_gettime(clockid_t clock, struct timespec *now) {
  static int (*read_clock)(clockid_t, struct timespec *);
  if (!read_clock) *(void **)&read_clock = dlsym(RTLD_NEXT, "clock_gettime");
  int result = read_clock(clock, now);
  if (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE) now->tv_sec += *ahead;
  return result;
}

int gettimeofday(struct timeval *now, void *zone) {
  struct timespec exact;
  int result = clock_gettime(CLOCK_REALTIME, &exact);
  now->tv_sec = exact.tv_sec, now->tv_usec = exact.tv_nsec / 1000;
  return result;
}

time_t time(time_t *now) {
  struct timespec exact;
  clock_gettime(CLOCK_REALTIME, &exact);
  if (now) *now = exact.tv_sec;
  return exact.tv_sec;
}

static struct timespec on_machine(const struct timespec *until) {
  struct timespec real = *until;
  real.tv_sec -= *ahead;
  return real;
}

int pthread_cond_timedwait(pthread_cond_t *condition, pthread_mutex_t *mutex,
                           const struct timespec *until) {
  int is_steady = condition->__data.__wrefs & 2;  /* as glibc marks CLOCK_MONOTONIC */
  struct timespec real = is_steady ? *until : on_machine(until);
  clockid_t clock = is_steady ? CLOCK_MONOTONIC : CLOCK_REALTIME;
  return pthread_cond_clockwait(condition, mutex, clock, &real);
}

int pthread_mutex_timedlock(pthread_mutex_t *mutex, const struct timespec *until) {
  struct timespec real = on_machine(until);
  return pthread_mutex_clocklock(mutex, CLOCK_REALTIME, &real);
}

int sem_timedwait(sem_t *semaphore, const struct timespec *until) {
  struct timespec real = on_machine(until);
  return sem_clockwait(semaphore, CLOCK_REALTIME, &real);
}
"""


class SteppedClock:
    """The clock of the processes that are started with its environment.

    Needs glibc 2.30 or newer and a C compiler.
    """

    def __init__(self, folder: Path):
        """Build the library in a folder."""
        self._file, library = folder / "clock_ahead", folder / "stepped_clock.so"
        self._file.write_bytes(struct.pack("q", 0))
        compiler = os.environ.get("CC", "cc")
        words = [compiler, "-shared", "-fPIC", "-O2", "-o", str(library), "-x", "c", "-"]
        subprocess.run(words, input=_SOURCE.encode(), check=True)
        self.environment: Mapping[str, str] = {
            "LD_PRELOAD": str(library),
            "CLOCK_AHEAD": str(self._file),
        }
        """What a process needs to have this clock."""

    def set_ahead(self, seconds: int) -> None:
        """Let the clock be ahead of the machine's by so many seconds, from now on."""
        with self._file.open("r+b") as file:
            file.write(struct.pack("q", seconds))
