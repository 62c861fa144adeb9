"""What is said of turnbuckles of 4 mm on three cables of 60, 63 and 70 mm."""

import numpy as np
import pytest

from shellform.output.workshop.turnbuckles import cut_counts, cutting_note, turnbuckle_notes

REST = np.array([0.060, 0.063, 0.070])


@pytest.mark.parametrize(
    ("hung", "short"),
    [
        ([0.064, 0.064, 0.074], None),  # cut to 60, 60 and 70 mm
        ([0.0655, 0.0641, 0.074], "2 cables are up to 1.5 mm too short to be hung in without force"),
        ([0.060, 0.060, 0.0743], "1 cable is up to 0.3 mm too short to be hung in without force"),
    ],
)
def test_cables_that_turnbuckles_are_too_short_to_hang_in_are_told(hung, short):
    cut, more = cutting_note(REST, 0.004), turnbuckle_notes(REST, np.array(hung), 0.004)
    assert cut.startswith("Cut to 2 different lengths, the fewest for 3 different rest lengths")
    assert "out by 4 mm" in cut
    assert len(more) == 1 + (short is not None)
    assert short is None or short in more[0]
    assert more[-1].startswith("2 turnbuckles are closed at the rest length")


def test_lengths_that_differ_in_their_last_bits_alone_are_one():
    lengths = np.where(np.arange(6) % 2 == 0, 0.05, np.nextafter(0.05, 1.0))
    assert cut_counts(lengths, None).rest_lengths == 1
    lengths[::2] += 1e-6
    assert cut_counts(lengths, None).rest_lengths == 2


def test_of_cables_that_are_each_cut_for_itself_no_lengths_to_cut_are_counted():
    assert cut_counts(REST, None).cut_lengths is None
    assert cut_counts(REST, 0.004).cut_lengths == 2
