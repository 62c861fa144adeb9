"""Case files of before 0.4 go on, under the names that their entries have now."""

from pathlib import Path

import pytest

from shellform.case.case import dump_case, load_case
from shellform.errors import InputError

CASE = Path(__file__).parent.parent.parent / "scripts/scale_model_radius.toml"


@pytest.mark.parametrize(
    ("older", "now"),
    [
        (["limits.critical_factor=1.5"], ["safety.critical_factor=1.5"]),
        (["limits.critical_factor=1.1"], []),  # 1.25 is asked for anyhow
        (["limits.critical_factor=1.3", "safety.critical_factor=1.4"], ["safety.critical_factor=1.4"]),
        (
            ["limits.critical_factor=1.3", 'limits.critical_loads=["additional", "design"]'],
            ["safety.critical_factor=1.3", "safety.critical_further={ additional = 1.3 }"],
        ),
        (['limits.critical_loads=["design"]', "limits.uplift=3.0"], ["limits.uplift=3.0"]),
        (
            ["robust.rest_length=3e-4", "robust.joints=0.2", "robust.loads_all=0.1", "robust.samples=9"],
            [
                "tolerances.cable_length=3e-4",
                "tolerances.connectors=0.2",
                "tolerances.load_all=0.1",
                "robust.samples=9",
            ],
        ),
        (
            ["robust.supports=1e-4", "robust.joints_all=0.0", "tolerances.supports=2e-4"],
            ["tolerances.supports=2e-4", "robust.deviations=1.0"],
        ),
        (
            ["optimise.robust=0.2", "optimise.misfit=0.4", "robust.samples=9"],
            ["optimise.built_misfit=0.2", "optimise.misfit=0.4", "robust.samples=9"],
        ),
    ],
)
def test_an_older_entry_is_the_present_one(older, now):
    assert dump_case(load_case(CASE, older)) == dump_case(load_case(CASE, now))


@pytest.mark.parametrize(
    ("older", "said"),
    [
        (["limits.critical_factor=much"], r"safety\.critical_factor"),
        (
            ["limits.critical_factor=1.3", "limits.critical_loads=7"],
            r"limits.critical_loads is no known entry",
        ),
        (['limits.critical_loads=["design"]', "limits=3"], "limits"),
        (["robust.rest_length=-1.0"], r"tolerances\.cable_length"),
    ],
)
def test_a_wrong_value_under_an_older_name_is_refused_under_the_present_one(older, said):
    with pytest.raises(InputError, match=said):
        load_case(CASE, older)
