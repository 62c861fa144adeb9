"""Points of scans as files give them."""

import pytest

from shellform.errors import InputError
from shellform.site.scan_points import read_points


@pytest.mark.parametrize(
    "text",
    [
        "0 0 1\n2 -0.5 0\n",
        " 0  0   1 \n 2 -0.5 0 \n",
        '"Z" "x" "Y"\n1 0 0\n0 2 -0.5\n',
        "0\t0\t1\n2\t-0.5\t0\n",
    ],
)
def test_points_may_be_parted_by_blanks_as_scanners_write_them(tmp_path, text):
    (tmp_path / "scan.xyz").write_text(text, encoding="utf-8")
    assert read_points(tmp_path / "scan.xyz", unit="mm").tolist() == [
        [0.0, 0.0, 0.001],
        [0.002, -0.0005, 0.0],
    ]


def test_a_point_that_is_no_number_is_told_by_its_line(tmp_path):
    (tmp_path / "scan.csv").write_text("# scan\nx,y,z\n1,2,3\nnan,nan,nan\n", encoding="utf-8")
    with pytest.raises(
        InputError, match=r"line 4: must be three finite numbers.*Leave the three cells empty"
    ):
        read_points(tmp_path / "scan.csv")


def test_points_with_numbers_and_without_names_of_columns_are_not_taken_for_x_y_and_z(tmp_path):
    file = tmp_path / "scan.csv"
    file.write_text("7,0.1,0.2,0.3\n3,0.4,0.5,0.6\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"has points with numbers.*7, 0\.1, 0\.2, 0\.3.*Name the columns"):
        read_points(file)
    file.write_text("7.0,0.1,0.2,255\n3.0,0.4,0.5,254\n", encoding="utf-8")
    assert read_points(file).tolist() == [[7.0, 0.1, 0.2], [3.0, 0.4, 0.5]], "with an intensity"


def test_points_with_two_columns_of_one_name_are_refused_unless_that_is_no_coordinate(tmp_path):
    file = tmp_path / "scan.csv"
    file.write_text("x,y,z,X\n1,2,3,4\n", encoding="utf-8")
    with pytest.raises(InputError, match="has two columns 'x'"):
        read_points(file)
    file.write_text("x,y,z,light,light\n1,2,3,4,5\n", encoding="utf-8")
    assert read_points(file).tolist() == [[1.0, 2.0, 3.0]]
