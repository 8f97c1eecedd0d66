# SPDX-License-Identifier: Apache-2.0
"""Soil files: the presets, and what is refused by name."""

import math

import pytest

from rover_physics.errors import SoilError
from rover_physics.terrain.soil_file import load_soils, soils_from_dict
from support.project.checkout import TOP

DUNE = {
    "model": "bekker_wong", "cohesion": 1040.0, "friction_angle": 0.488692, "k_c": 990.0,
    "k_phi": 1528430.0, "n": 1.1, "shear_modulus": 0.025, "source": "a book",
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "published"),
    [
        ("lunar_nominal", (170.0, 35.0, 1.4e3, 820e3, 1.0, 0.0178)),
        ("mars_simulant", (300.0, 17.8, 5.79e3, 180e3, 0.8, 0.01)),
        ("dry_sand", (1040.0, 28.0, 0.99e3, 1528.43e3, 1.1, 0.025)),
        ("lete_sand", (1300.0, 31.1, 102e3, 5301e3, 0.79, 0.012)),
    ],
)
def test_presets_have_the_published_values_in_si_units(name, published):
    soil = load_soils()[name]
    degrees = math.degrees(soil.friction_angle)
    values = (soil.cohesion, degrees, soil.k_c, soil.k_phi, soil.n, soil.shear_modulus)
    assert values == pytest.approx(published, rel=3e-6)


def test_every_preset_is_in_the_docs():
    text = (TOP / "docs" / "soil.md").read_text(encoding="utf-8")
    for name in load_soils():
        assert f"`{name}`" in text


def test_a_coulomb_soil_may_leave_its_friction_to_the_map():
    entries = {"slab": {"model": "coulomb", "friction": 0.6}, "ground": {"model": "coulomb"}}
    soils = soils_from_dict({k: v | {"source": "measured"} for k, v in entries.items()}, "mine")
    slab = soils["slab"]
    assert (slab.name, slab.model, slab.source) == ("slab", "coulomb", "measured")
    assert slab.friction == 0.6 and math.isnan(slab.n)
    assert math.isnan(soils["ground"].friction)


COULOMB = {"model": "coulomb", "source": "s"}


@pytest.mark.parametrize(
    ("data", "text"),
    [
        *[(data, "is .*; it must be a mapping of names to soils") for data in ({}, "dune")],
        ({7: COULOMB}, "soil name is 7; it must be a text"),
        ({"slab": COULOMB | {"n": 1.0}}, r"unknown key slab\.n"),
        ({"slab": COULOMB | {"friction": 0.0}}, r"slab\.friction is 0\.0; it must be .*above 0"),
        ({"dune": DUNE | {"model": "mohr"}},
         "dune.model is 'mohr'; it must be coulomb or bekker_wong"),
        ({"dune": DUNE | {"cohesion": "1e3"}}, "dune.cohesion is '1e3'.*YAML reads it as text"),
        ({"dune": DUNE | {"friction_angle": 28.0}},
         "dune.friction_angle is 28.0; .* at most 1.2 in rad"),
        ({"dune": DUNE | {"friction_angle": 0.0, "cohesion": 0.0}},
         "dune.cohesion is 0.0; .*some strength"),
    ],
)  # fmt: skip
def test_what_is_no_mapping_of_soils_and_wrong_values_are_refused_by_their_key(data, text):
    with pytest.raises(SoilError, match=f"my soils: {text}"):
        soils_from_dict(data, "my soils")
