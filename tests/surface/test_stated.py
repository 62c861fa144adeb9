"""The unit that a CAD file states."""

from pathlib import Path

import pytest

from shellform.run.first_look import check_file
from shellform.surface.readers.stated import stated_unit

DATA = Path(__file__).parent.parent / "data"
MILLI = "#1 = ( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) );"
INCH = "#2=(CONVERSION_BASED_UNIT('INCH',#1)LENGTH_UNIT()NAMED_UNIT(#3));"


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        (MILLI, "mm"),
        ("#1=(NAMED_UNIT(*)SI_UNIT($,.METRE.)LENGTH_UNIT());", "m"),
        (MILLI + "\n" + INCH, "in"),
        ("#1=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.CENTI.,\n.METRE.));", "cm"),
        ("#1=(CONVERSION_BASED_UNIT('FOOT',#9)LENGTH_UNIT()NAMED_UNIT(#3));", "ft"),
        ("#1 = ( NAMED_UNIT(*) PLANE_ANGLE_UNIT() SI_UNIT($,.RADIAN.) );", None),
        ("", None),
    ],
)
def test_step_s_length_unit_is_told_an_inch_before_the_millimetre_that_defines_it(tmp_path, text, unit):
    (tmp_path / "a.step").write_text(text)
    assert stated_unit(tmp_path / "a.step", "step") == unit


@pytest.mark.parametrize(
    ("flag", "unit"),
    [
        ("2,2HMM", "mm"),
        ("1,4HINCH", "in"),
        ("6,1HM", "m"),
        ("3,2HCM", "cm"),
        ("x", None),
        ("²,2HMM", None),
        ("9" * 5000 + ",2HMM", None),
        ("9" * 5000 + "HMM", None),
    ],
)
def test_iges_global_section_says_the_unit(tmp_path, flag, unit):
    text = f"1H,,1H;,4Hmesh,7Ha;b.igs,4Hhere,3H1,0,32,38,6,308,15,4Hmesh,1.,{flag},1,0.01;"
    lines = [f"{text[k : k + 72]:<72}G{1 + k // 72:>7}" for k in range(0, len(text), 72)]
    (tmp_path / "a.igs").write_text("\n".join(lines), encoding="latin-1")
    assert stated_unit(tmp_path / "a.igs", "iges") == unit


def test_check_names_the_unit_that_a_file_carries():
    assert check_file(DATA / "dome_mm.step", {}, allow_scripts=False).unit == "mm, as the file states"
