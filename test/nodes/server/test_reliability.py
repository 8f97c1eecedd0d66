"""Short trials of a traverse server process: many clients, overload, kills, disks, same bits."""

import pytest

from benchmarks.server_trials import bits, disk, identity, interruptions, load
from benchmarks.server_trials.stage import open_stage, run_together
from support.project.without_disk import fill_disk

MANY = 12
BUDGET, LATE = 1.0, 2.0
"""time_budget [s], and how late an answer may be on a busy machine [s]: one question after another
would take 50 s. The figure of a quiet machine is in docs/reliability.md."""


@pytest.fixture
def stage():
    with open_stage() as opened:
        yield opened


@pytest.mark.slow
@pytest.mark.parametrize("is_paused", [False, True], ids=["system clock", "paused clock"])
@pytest.mark.parametrize("ask", [identity.check_paths, identity.plan_paths])
def test_two_clients_at_once_never_take_the_others_verdict_for_their_own(stage, is_paused, ask):
    clients = identity.start_server(stage, is_paused)
    tallies = run_together(
        *(
            lambda client=client, errand=errand: ask(client, errand, MANY)
            for client, errand in zip(clients, identity.ERRANDS, strict=True)
        )
    )
    assert [tally.accepted for tally in tallies] == [MANY, MANY]
    assert not [mix_up for tally in tallies for mix_up in tally.mix_ups]


@pytest.mark.slow
@pytest.mark.timed
def test_fifty_short_questions_at_once_are_all_answered(stage):
    found = load.burst(stage, 50, 5.0, half_length=1.5, spacing=0.05)
    assert found.codes.keys() <= {"traversable", "busy", "too_long"}
    assert max(found.times) < 5.0 + LATE


@pytest.mark.slow
@pytest.mark.timed
def test_fifty_long_questions_at_once_are_answered_or_refused_within_the_budget(stage):
    found = load.burst(stage, 50, BUDGET, half_length=45.0, spacing=0.001)
    assert sum(found.codes.values()) == 50 and found.codes["busy"] > 40
    assert found.codes.keys() <= {"traversable", "busy", "too_long"}
    assert max(found.times) < BUDGET + LATE


@pytest.mark.slow
def test_no_answer_is_lost_under_questions_without_a_pause(stage):
    found = load.soak(stage, 4.0, clients=2)
    assert len(found.times) > 20 and found.lost == found.refused == 0


@pytest.mark.slow
@pytest.mark.timed
def test_after_a_sudden_death_a_new_server_has_the_latched_map(stage):
    found = interruptions.time_restart(stage)
    assert 0.0 < found.answer <= found.plan < 15.0


@pytest.mark.slow
@pytest.mark.timed
def test_requests_are_served_during_a_question(stage):
    found = interruptions.time_hearing(stage, 1)
    longest = max(found.parameter + found.map + found.cancel + found.cancelled)
    assert longest < 1.0


@pytest.mark.slow
@pytest.mark.timed
def test_a_signal_during_a_question_ends_the_server_soon(stage):
    assert interruptions.time_signal(stage) < 1.5


@pytest.mark.slow
def test_answers_are_the_same_to_the_bit_with_other_threads_and_after_a_restart():
    hashes = []
    for threads in (1, 2, 2):
        with open_stage() as stage:
            hashes.append(bits.hash_answers(stage, threads))
    assert len(set(hashes)) == 1


@pytest.mark.slow
def test_a_server_starts_on_a_full_disk_without_a_log_file_and_says_so(tmp_path):
    started = disk.start(disk.ROOT, tmp_path, fill_disk)
    (warning,) = started.warnings
    assert "no log file is written: File too large" in warning
