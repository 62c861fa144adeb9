"""What is said of turnbuckles of 4 mm on three cables of 60, 63 and 70 mm."""

import numpy as np
import pytest

from shellform.output.workshop.turnbuckles import turnbuckle_notes

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
    cut, *more = turnbuckle_notes(REST, np.array(hung), 0.004, lengths=3)
    assert cut.startswith("Cut to 2 different lengths, the fewest for 3 different rest lengths")
    assert "out by 4 mm" in cut
    assert len(more) == 1 + (short is not None)
    assert short is None or short in more[0]
    assert more[-1].startswith("2 turnbuckles are closed at the rest length")
