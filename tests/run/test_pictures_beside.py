"""Maps that a process of its own draws while another stage works."""

import shutil

import pytest

from shellform.records.progress import Event, Kind
from shellform.run import pictures_beside
from shellform.run.figures import draw_maps
from shellform.run.folder import read_run
from shellform.run.pictures_beside import DrawnMaps, draw_all_but, maps_beside


@pytest.fixture
def run(begun, tmp_path):
    return read_run(shutil.copytree(begun, tmp_path / "run"))


def pictures(folder):
    return {file.name: file.read_bytes() for file in sorted((folder / "figures").iterdir())}


def test_maps_drawn_beside_other_work_are_the_bytes_of_those_drawn_here(run, tmp_path, monkeypatch):
    monkeypatch.setattr(pictures_beside, "cores", lambda: 2)
    here = shutil.copytree(run.folder, tmp_path / "here")
    with maps_beside(run.folder) as drawn:
        assert draw_maps(read_run(here))
        found = drawn()
    assert found == DrawnMaps("initial", True, ())
    assert len(pictures(here)) > 12
    assert pictures(run.folder) == pictures(here)


def test_a_child_that_fails_has_drawn_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(pictures_beside, "cores", lambda: 2)
    with maps_beside(tmp_path / "nothing") as drawn:
        assert drawn() is None


def test_on_a_single_core_no_child_is_begun(run, monkeypatch):
    monkeypatch.setattr(pictures_beside, "cores", lambda: 1)
    with maps_beside(run.folder) as drawn:
        assert drawn() is None
    assert pictures(run.folder) == {}


def test_what_isn_t_drawn_when_the_other_work_breaks_off_is_given_up(run, monkeypatch):
    monkeypatch.setattr(pictures_beside, "cores", lambda: 2)
    begun = []
    usual = pictures_beside.subprocess.Popen

    def noted(*arguments, **options):
        begun.append(usual(*arguments, **options))
        return begun[-1]

    monkeypatch.setattr(pictures_beside.subprocess, "Popen", noted)
    with pytest.raises(KeyboardInterrupt), maps_beside(run.folder):
        raise KeyboardInterrupt
    assert begun[0].returncode == -9


@pytest.mark.parametrize(
    ("maps", "mapped"),
    [
        (None, None),
        (DrawnMaps("unbraced", True, ("no pictures",)), None),
        (DrawnMaps("initial", True, ()), True),
        (DrawnMaps("initial", False, ("no pictures",)), False),
    ],
)
def test_maps_of_another_design_than_the_one_to_build_are_drawn_anew_and_notes_of_the_others_told(
    run, monkeypatch, maps, mapped
):
    asked, told = [], []

    def drawn(run, *, mapped=None, report):
        asked.append(mapped)
        return bool(mapped)

    monkeypatch.setattr(pictures_beside, "draw_everything", drawn)
    assert draw_all_but(maps, run, report=told.append) is bool(mapped)
    assert asked == [mapped]
    notes = maps.notes if mapped is not None else ()
    assert told == [Event("figures", note, Kind.NOTE) for note in notes]
