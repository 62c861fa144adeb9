"""What was left out of a net is known by its kind, also once it was saved."""

import json

import numpy as np

from shellform.net.notes import NetNote, NoteKind
from shellform.net.saved import load_net, save_net


def test_notes_keep_their_kind_in_a_file_and_older_files_have_none(net, tmp_path):
    file = tmp_path / "net.npz"
    save_net(file, net)
    notes = load_net(file).notes
    assert notes == net.notes
    assert [note.kind for note in notes] == [NoteKind.JOINTS]
    with np.load(file) as data:
        arrays = dict(data)
    meta = json.loads(str(arrays["meta"]))
    meta["notes"] = ["11 joints were left out"]
    np.savez(file, **{**arrays, "meta": np.array(json.dumps(meta))})
    assert load_net(file).notes == (NetNote(NoteKind.OTHER, "11 joints were left out"),)
