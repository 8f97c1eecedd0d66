"""Trials of the traverse server in the field: many clients, overload, kills, full disks.

Run from the repository: python -m benchmarks.reliability_server [--topics burst,restart ...]. Each
topic starts servers in processes of their own and asks them over DDS. The figures are in
docs/reliability.md.
"""

import argparse
import statistics
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from benchmarks.measure import Figure, quantile, show, write
from benchmarks.server_trials import bits, disk, identity, interruptions, load, slopes
from benchmarks.server_trials.stage import open_stage, run_together

RESULTS = Path(__file__).resolve().parents[1] / "bench_output" / "reliability_server.json"
Asked = argparse.Namespace
"""The arguments of the command line."""


def measure_identity(asked: Asked) -> Iterator[Figure]:
    """Two clients at once, on the system's time and on a simulated time that stands still."""
    for is_paused in (False, True):
        clock = "paused clock" if is_paused else "system clock"
        with open_stage() as stage:
            clients = identity.start_server(stage, is_paused)
            for name, ask in (
                ("check_path", identity.check_paths),
                ("can_traverse", identity.plan_paths),
            ):
                tallies = run_together(
                    *(
                        lambda c=client, e=errand, ask=ask: ask(c, e, asked.questions)
                        for client, errand in zip(clients, identity.ERRANDS, strict=True)
                    )
                )
                told = f"{name}, {clock}:"
                accepted = sum(tally.accepted for tally in tallies)
                apart = sum(tally.told_apart for tally in tallies)
                mixed = sum(len(tally.mix_ups) for tally in tallies)
                yield _count(f"{told} own verdicts", accepted, at_least=2 * asked.questions)
                yield _count(f"{told} verdicts known to be another's", apart)
                yield _count(f"{told} mix-ups", mixed, most=0)


def measure_burst(asked: Asked) -> Iterator[Figure]:
    """50 questions at once, light ones and ones that take longer than the budget."""
    sizes = {"light": (1.5, 0.05), "1 s each": (30.0, 0.003), "beyond the budget": (45.0, 0.001)}
    for name, (half_length, spacing) in sizes.items():
        with open_stage() as stage:
            found = load.burst(stage, asked.burst, asked.budget, half_length, spacing)
        for code, count in sorted(found.codes.items()):
            yield _count(f"{name}: {code}", count)
        yield _seconds(f"{name}: last answer", max(found.times), asked.budget + 0.2)


def measure_soak(asked: Asked) -> Iterator[Figure]:
    """Questions without a pause: from 1 and 2 clients shortly, then long at the higher rate."""
    rates = {}
    for clients in (1, 2):
        with open_stage() as stage:
            rates[clients] = len(load.soak(stage, asked.probe, clients).times) / asked.probe
        yield Figure("soak", f"questions by {clients} clients", rates[clients], "1/s", repeats=1)
    with open_stage() as stage:
        found = load.soak(stage, 60.0 * asked.minutes, max(rates, key=rates.__getitem__))
    settled = min(60, len(found.memory) // 2)
    yield _count("questions answered", len(found.times))
    yield _count("answers lost", found.lost, most=0)
    yield _count("questions refused", found.refused, most=0)
    yield Figure("soak", "minutes", asked.minutes, "min", repeats=1)
    yield Figure("soak", "memory after the first minute", found.memory[settled], "MB", repeats=1)
    yield Figure(
        "soak", "growth after the first minute", 100.0 * found.growth(settled), "%", 1.0, repeats=1
    )
    for share in (0.5, 0.99, 1.0):
        yield Figure(
            "soak",
            f"response time, quantile {share:g}",
            1e3 * quantile(found.times, share),
            "ms",
            repeats=len(found.times),
        )


def measure_restart(asked: Asked) -> Iterator[Figure]:
    """SIGKILL during a question, and a new start."""
    found = []
    for _ in range(asked.repeats):
        with open_stage() as stage:
            found.append(interruptions.time_restart(stage))
    for name, times in (
        ("first answer", [one.answer for one in found]),
        ("first plan, on the latched map", [one.plan for one in found]),
    ):
        yield _seconds(f"SIGKILL, start: {name}, p50", statistics.median(times), 3.0)
        yield _seconds(f"SIGKILL, start: {name}, longest", max(times), 3.0)


def measure_hearing(asked: Asked) -> Iterator[Figure]:
    """Requests and SIGINT during a question."""
    with open_stage() as stage:
        found = interruptions.time_hearing(stage, asked.repeats)
    for name, times in (
        ("set_parameters", found.parameter),
        ("map", found.map),
        ("cancel", found.cancel),
        ("cancelled question", found.cancelled),
    ):
        middle, longest = statistics.median(times), max(times)
        yield Figure("", f"{name}: p50", 1e3 * middle, "ms", 100.0, repeats=len(times))
        yield Figure("", f"{name}: longest", 1e3 * longest, "ms", 100.0, repeats=len(times))
    ends = []
    for _ in range(asked.repeats):
        with open_stage() as stage:
            ends.append(interruptions.time_signal(stage))
    yield _seconds("SIGINT during a question: longest until exit", max(ends))


def measure_slope(asked: Asked) -> Iterator[Figure]:
    """Questions of 20 m on the Mars yard, and of 5 m on boulders with cells of 1 cm."""
    yard = slopes.load_real(slopes.MARS_YARD)
    stones = slopes.refine(slopes.load_real(slopes.BOULDERS), 3)
    for name, ground, length in (
        ("20 m, 9 cm cells", yard, 20.0),
        ("5 m, 1 cm cells", stones, 5.0),
    ):
        with open_stage() as stage:
            found = slopes.time_questions(
                stage, ground, length, asked.slopes, time_budget=asked.budget
            )
        times = [one.time for one in found]
        yield _seconds(f"{name}: p50", statistics.median(times))
        yield _seconds(f"{name}: longest", max(times), asked.budget + 0.2)
        yield _count(f"{name}: questions", len(found))
        yield _count(f"{name}: passable", sum(not one.code for one in found))
        yield _count(f"{name}: too_long", sum(one.code == "too_long" for one in found))
        yield _count(f"{name}: most other goals tried", max(one.goals for one in found))


def measure_bits(asked: Asked) -> Iterator[Figure]:
    """The same questions with one thread, with two, and after another start."""
    hashes = []
    for threads in (1, 2, 2):
        with open_stage() as stage:
            hashes.append(bits.hash_answers(stage, threads))
    yield _count("answers that differ: 1 or 2 threads", int(hashes[0] != hashes[1]), most=0)
    yield _count("answers that differ: after a restart", int(hashes[1] != hashes[2]), most=0)


def measure_disk(asked: Asked) -> Iterator[Figure]:
    """Starts with nothing compiled on a read-only and on a full disk."""
    for name, start in (("read-only", disk.start_read_only), ("full", disk.start_full)):
        with tempfile.TemporaryDirectory() as folder:
            found = start(Path(folder) / "copy")
        yield _seconds(f"{name} disk: until ready, nothing compiled", found.time)
        said = sum("are not cached" in line for line in found.warnings)
        yield _count(f"{name} disk: warnings that kernels are not cached", said, at_least=1)


TOPICS: dict[str, Callable[[Asked], Iterator[Figure]]] = {
    "identity": measure_identity,
    "burst": measure_burst,
    "soak": measure_soak,
    "restart": measure_restart,
    "hearing": measure_hearing,
    "slope": measure_slope,
    "bits": measure_bits,
    "disk": measure_disk,
}
"""Measurement of each topic."""


def _count(
    name: str, value: int, most: float | None = None, at_least: float | None = None
) -> Figure:
    if at_least is not None:
        return Figure("", name, value, "", at_least, at_least=True, repeats=1)
    return Figure("", name, value, "", most, repeats=1)


def _seconds(name: str, value: float, most: float | None = None) -> Figure:
    return Figure("", name, value, "s", most, repeats=1)


def read_arguments(words: list[str]) -> Asked:
    """Return the arguments."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--topics", default=",".join(TOPICS), help="default: %(default)s")
    parser.add_argument("--questions", type=int, default=1000, help="of each client in identity")
    parser.add_argument("--burst", type=int, default=50, help="questions at once")
    parser.add_argument("--budget", type=float, default=5.0, help="time_budget in burst, slope, s")
    parser.add_argument("--minutes", type=float, default=10.0, help="of the soak")
    parser.add_argument("--probe", type=float, default=10.0, help="of each rate before it, s")
    parser.add_argument("--repeats", type=int, default=5, help="of restart and hearing")
    parser.add_argument("--slopes", type=int, default=20, help="questions on each real map")
    return parser.parse_args(words)


def main(words: list[str]) -> int:
    """Run the topics, print a table after each, and write all figures as JSON."""
    asked, figures = read_arguments(words), []
    for topic in asked.topics.split(","):
        found = [Figure(**{**vars(figure), "topic": topic}) for figure in TOPICS[topic](asked)]
        show(found)
        figures += found
    write(figures, RESULTS)
    return 0 if all(figure.met is not False for figure in figures) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
