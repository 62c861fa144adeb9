"""`design --watch`: again at each change of case or surface; bad input is told and waited out; Ctrl-C ends it
with 130."""

import queue
import shutil
import signal
import threading

import pytest

from shellform.cli.watching import case_files, watched
from shellform.errors import InputError
from shellform.records.progress import Event
from tests.command import ROOT, begin, shellform
from tests.stubs import CASE

WAIT = 240.0  # s, at the most, on a machine that others use


class Lines:
    """What a process says on standard error, line by line."""

    def __init__(self, stream):
        self.told = queue.Queue()
        self.every = []
        threading.Thread(target=lambda: [self.told.put(line) for line in stream], daemon=True).start()

    def until(self, *words):
        """Reads on up to a line with one of the words."""
        while True:
            line = self.told.get(timeout=WAIT)
            self.every.append(line)
            if any(word in line for word in words):
                return line


def test_changes_of_case_and_surface_are_taken_up_and_bad_input_is_waited_out_until_ctrl_c(tmp_path):
    surface, case = tmp_path / "dome.py", tmp_path / "dome.toml"
    shutil.copy(ROOT / "surfaces/dome.py", surface)
    text = CASE.replace(str(ROOT / "surfaces/dome.py"), "dome.py")
    case.write_text(text, encoding="utf-8")
    job = begin("design", case, "--output", tmp_path / "run", "--until", "net", "--watch", "--allow-scripts")
    said = Lines(job.stderr)
    try:
        said.until("waiting for a change of dome.toml or dome.py")
        case.write_text(text.replace("spacing = 0.15", "spacing = 0.16"), encoding="utf-8")
        said.until("surface: kept")
        said.until("waiting for a change")
        case.write_text("[net", encoding="utf-8")
        assert "isn't valid TOML" in said.until("refused")
        said.until("waiting for a change of dome.toml;")
        case.write_text(text, encoding="utf-8")
        said.until("net: done")
        said.until("waiting for a change")
        surface.write_text(surface.read_text(encoding="utf-8") + "\n# another\n", encoding="utf-8")
        said.until("surface: done")
        said.until("waiting for a change")
    finally:
        job.send_signal(signal.SIGINT)
    assert job.wait(WAIT) == 130
    assert "Traceback" not in "".join(said.every)


def stopped(*_):
    raise KeyboardInterrupt


def test_a_run_under_way_ends_when_its_file_changes_and_is_done_again(tmp_path, capsys):
    file = tmp_path / "case.toml"
    file.write_text("a", encoding="utf-8")
    events = []

    def once(ending):
        if events:
            stopped()
        heard = ending(events.append)
        heard(Event("net", "one"))
        file.write_text("longer", encoding="utf-8")
        heard(Event("net", "two"))
        raise AssertionError("the run goes on")

    with pytest.raises(KeyboardInterrupt):
        watched(lambda: [file], once)
    assert [event.text for event in events] == ["one", "two"]
    assert capsys.readouterr().err == ""


def test_an_error_of_an_overtaken_run_is_not_told_and_one_of_ours_is_raised(tmp_path, capsys):
    file = tmp_path / "case.toml"
    file.write_text("a", encoding="utf-8")
    calls = []

    def once(ending):
        calls.append(ending)
        if len(calls) == 1:
            file.unlink()  # as editors do, who then put another in its place
            raise InputError("can't be read", where=str(file))
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        watched(lambda: [file], once)
    assert "can't be read" not in capsys.readouterr().err


def test_the_buffers_of_a_scene_are_watched_with_it_also_before_they_are_there(tmp_path):
    case, scene = tmp_path / "case.toml", tmp_path / "dome.gltf"
    case.write_text(CASE.replace(str(ROOT / "surfaces/dome.py"), "dome.gltf"), encoding="utf-8")
    assert case_files(case, []) == [case, scene]
    scene.write_text('{"buffers": [{"uri": "dome.bin", "byteLength": 3}]}', encoding="utf-8")
    assert case_files(case, []) == [case, scene, tmp_path / "dome.bin"]
    assert case_files(case, ["net.spacing=-1"]) == [case]


def test_the_case_s_own_catalogue_is_watched_with_it_also_while_it_is_refused(tmp_path):
    case, mine = tmp_path / "case.toml", tmp_path / "mine.toml"
    before, _, after = CASE.partition("[rod]")
    case.write_text(
        f'{before}[rod]\ncatalogue = "mine.toml"\nsection = "2 mm"\n{after[after.index("[joint]") :]}',
        encoding="utf-8",
    )
    good = (
        "[material]\nyoung = 40e9\nshear = 4e9\ndensity = 1900\nstrength = 255e6\n[sizes]\nround = [0.002]\n"
    )
    for text in (good, good.replace("0.002", "-0.002"), "[material"):
        mine.write_text(text, encoding="utf-8")
        assert case_files(case, [])[0] == case
        assert case_files(case, [])[-1] == mine.resolve()
    case.write_text("[rod", encoding="utf-8")
    assert case_files(case, []) == [case]


def test_what_is_wrong_from_the_outset_is_refused(tmp_path):
    ended = shellform("design", tmp_path / "none.toml", "--output", tmp_path / "run", "--watch")
    assert ended.returncode == 2
    assert "none.toml" in ended.stderr
    assert not (tmp_path / "run").exists()
