"""A run left after its initial design, made once for all tests of run folders."""

from pathlib import Path

import pytest

from shellform.study.case import load_case
from shellform.study.run import run_case

CASE = Path(__file__).parent.parent.parent / "scripts/scale_model.toml"


@pytest.fixture(scope="session")
def begun(tmp_path_factory):
    folder = tmp_path_factory.mktemp("begun") / "run"
    run_case(load_case(CASE), folder, until="initial")
    return folder
