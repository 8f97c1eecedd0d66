# SPDX-License-Identifier: Apache-2.0
"""YAML is read strictly, and whatever a file holds, its error is one short line."""

import time

import pytest

from rover_physics import RoverError, load_rover
from rover_physics.errors import RoverFileError
from rover_physics.files.config_files import find_config
from rover_physics.files.yaml_file import parse_yaml

PRESET = find_config("rovers/lsr1.yaml").read_text(encoding="utf-8")
HOSTILE = [
    "!!map foo",
    "!!timestamp 2001-99-99",
    "!!int ''",
    "!!binary é",
    "!!python/name:os.system",
    "!!set {a}",
    "&self [*self]",
    "1" * 6000,
    "-1e" + "9" * 4000,
    '"\\e[31m\\n\\0"',
    "[" * 600,
    "{? [1]: 2}",
]


def error_of(folder, text) -> str:
    """Return the error of a file with this text, without the file's name."""
    path = folder / "file.yaml"
    path.write_text(text, encoding="utf-8", errors="surrogatepass")
    with pytest.raises(RoverError) as raised:
        load_rover(path)
    return str(raised.value).removeprefix(f"{path}: ")


PLACES = {
    "number": PRESET.replace("radius: 0.10 ", "radius: %s "),
    "point": PRESET.replace("rear: [-0.40, 0.31, -0.20]", "rear: %s"),
    "key": PRESET.replace("belly: {z: -0.06,", "belly: {z: -0.06, ? %s : 1,"),
    "file": "%s",
}


@pytest.mark.parametrize("value", HOSTILE, ids=lambda value: value[:20])
def test_a_hostile_value_ends_in_one_short_line_wherever_it_stands(tmp_path, value):
    for form in PLACES.values():
        assert "%s" in form
        text = error_of(tmp_path, form.replace("%s", value))
        assert len(text) <= 300
        assert text.isprintable()


def levels(form: str) -> str:
    """Return 30 levels of YAML, each of nine references to the one above."""
    lines = [f"a0: &a0 {form % ('x: 1', '')}"]
    for level in range(1, 30):
        above = ",".join([f"*a{level - 1}"] * 9)
        lines.append(f"a{level}: &a{level} " + form % (f"x{level}: 1", above))
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("form", ["[{%s}, %s]", "{%s, <<: [%s]}"], ids=["aliases", "merges"])
def test_a_bomb_of_references_is_refused_at_once(tmp_path, form):
    start = time.perf_counter()
    for tail in (PRESET.replace("radius: 0.10 ", "radius: *a29 "), "? *a29\n: 1\n"):
        assert len(error_of(tmp_path, levels(form) + tail)) <= 300
    assert time.perf_counter() - start < 30.0


def test_of_merged_keys_the_nearest_counts():
    text = "a: &a {x: 1, y: 1}\nb: &b {y: 2}\nc: {<<: [*b, *a], z: 3}\nd: {<<: *a, x: 4}\n"
    assert parse_yaml(text)["c"] == {"x": 1, "y": 2, "z": 3}
    assert parse_yaml(text)["d"] == {"x": 4, "y": 1}


def test_impossible_merges_and_references_and_deep_nesting_are_refused_at_once():
    keys = ",".join(f"k{k}: 1" for k in range(3000))
    start = time.perf_counter()
    for text, said in (
        ("a: &a {x: 1}\nb: {<<: *a, x: 2, x: 3}", "duplicate key x in lines 2 and 2"),
        ("a: &a {b: *a}\n", "references stand for inf values"),
        ("- " * 50_000, "recursion"),
        (
            f"a: &a {{{keys}}}\nb: {{<<: [{'*a,' * 10_000}]}}\n",
            r"references stand for 6e\+07 values",
        ),
    ):
        with pytest.raises(RoverFileError, match=said):
            parse_yaml(text)
    assert time.perf_counter() - start < 30.0


def test_a_large_file_and_bytes_that_are_no_text_are_refused_before_they_are_parsed(tmp_path):
    text = error_of(tmp_path, "- 1\n" * 1_000_000)
    assert text == "is larger than 100000 bytes, the most that is read"
    assert "special characters are not allowed" in error_of(tmp_path, "a: \0")
    assert "not a text file in UTF-8" in error_of(tmp_path, "a: \ud800")
