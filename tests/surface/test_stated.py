"""The unit that a CAD file states."""

from pathlib import Path

import pytest
import rhino3dm

from shellform.errors import InputError
from shellform.run.first_look import check_file
from shellform.surface.readers.reading import read_surface
from shellform.surface.readers.stated import _words, line_without_number, stated_unit

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


@pytest.mark.parametrize(
    ("ending", "old", "new", "line"),
    [
        ("step", "4.188790204786,6.28318530718,", "4.188790204786,nan,", 57),
        ("step", "4.188790204786,6.28318530718,", "4.188790204786, -NaN,", 57),
        (
            "step",
            "ISO-10303-21;",
            "ISO-10303-21;\n/* of Nan, nan */ #9000=PERSON('nan, nan','\n',.NAN.);",
            None,
        ),
        ("brep", "\n8 0 6.2831853071795862", "\n8 0 nan", 8),
        ("igs", "4Hmesh", "4Hnan,", None),
        ("igs", "2.094395102,4.188790205,4.188790205,", "2.094395102,nan        ,4.188790205,", 30),
    ],
)
def test_a_line_that_has_nan_for_a_number_is_found_and_refused(tmp_path, ending, old, new, line):
    """OpenCASCADE didn't come to an end on such STEP and BREP files, and gave 0.65 m² instead of 0.62 of an
    IGES one."""
    text = (DATA / f"dome_mm.{ending}").read_text(encoding="latin-1")
    bad = tmp_path / f"dome.{ending}"
    bad.write_text(text.replace(old, new, 1), encoding="latin-1")
    kind = {"igs": "iges"}.get(ending, ending)
    assert line_without_number(bad, kind) == line
    if line:
        with pytest.raises(InputError, match=f"line {line} has nan for a number"):
            read_surface(bad)


def test_words_of_an_iges_file_s_other_sections_are_no_numbers(tmp_path):
    """Its start and its global section are text, and what stands behind column 72 counts lines."""
    lines = [
        ("beams, nan, plates", "S"),
        ("1H,,1H;,nan,2", "G"),
        ("110,1.,2.,3.,4.,5.,6.;", "P"),
        ("110,1.,nan,3.;", "P"),
    ]
    text = "\n".join(f"{words:<72}{section}{1:>7}" for words, section in lines)
    (tmp_path / "a.igs").write_text(text, encoding="latin-1")
    assert line_without_number(tmp_path / "a.igs", "iges") == 4
    (tmp_path / "a.igs").write_text(
        text.replace("110,1.,nan,3.;", "110,1.,3.;".ljust(14)), encoding="latin-1"
    )
    assert line_without_number(tmp_path / "a.igs", "iges") is None
    long = f"#1=CARTESIAN_POINT('',({'0.,' * 15}    P, nan));"
    assert long[72] == "P"
    (tmp_path / "a.step").write_text(long)
    assert line_without_number(tmp_path / "a.step", "step") == 1


def test_check_names_the_unit_that_a_file_carries():
    assert check_file(DATA / "dome_mm.step", {}, allow_scripts=False).unit == "mm, as the file states"


def test_check_says_the_unit_that_was_given_for_a_rhino_file_without_one(tmp_path):
    model, mesh = rhino3dm.File3dm(), rhino3dm.Mesh()
    model.Settings.ModelUnitSystem = getattr(rhino3dm.UnitSystem, "None")
    for point in [(0, 0, 0), (9000, 0, 0), (9000, 6000, 0), (0, 6000, 800)]:
        mesh.Vertices.Add(*point)
    mesh.Faces.AddFace(0, 1, 2, 3)
    model.Objects.AddMesh(mesh)
    model.Write(str(tmp_path / "a.3dm"), 7)
    with pytest.raises(InputError, match=r"no usable unit.*--unit"):
        check_file(tmp_path / "a.3dm", {}, allow_scripts=False)
    found = check_file(tmp_path / "a.3dm", {"unit": "mm"}, allow_scripts=False)
    assert (found.unit, found.surface.size[0]) == ("mm", 9.0)
    assert (
        check_file(DATA / "tna_tutorial.3dm", {"object": "mesh 1"}, allow_scripts=False).unit
        == "the file's own"
    )


def test_a_section_s_words_end_with_its_semicolon_and_strings_where_they_say():
    assert _words("1H,,1H;,4Hmesh, 3Ha;b,7,,2.5;8,9") == [",", ";", "mesh", "a;b", "7", "", "2.5"]
    assert _words("12,3Habc") == ["12", "abc"]
    assert _words("") == []


@pytest.mark.parametrize(("count", "unit"), [(13, None), (14, "mm")])
def test_what_follows_a_section_s_end_states_no_unit(tmp_path, count, unit):
    """The unit's flag is the section's 14th word."""
    text = ",".join(str(1 + k) if k < 13 else "2" for k in range(count)) + ";2,2,2,2"
    (tmp_path / "a.igs").write_text(f"{text:<72}G{1:>7}\n", encoding="latin-1")
    assert stated_unit(tmp_path / "a.igs", "iges") == unit


@pytest.mark.parametrize(
    ("flag", "unit"),
    [("1", "in"), ("2", "mm"), ("4", "ft"), ("5", "mi"), ("6", "m"), ("7", "km"), ("8", "mil"), ("9", "µm"), ("10", "cm"), ("11", "µin"), ("3", None), ("12", None), ("3,2Hin", "in"), ("3,4HFOOT", "ft")],
)  # fmt: skip
def test_each_flag_of_iges_stands_for_its_unit(tmp_path, flag, unit):
    text = "0," * 13 + f"{flag};"
    (tmp_path / "a.igs").write_text(f"{text:<72}G{1:>7}\n", encoding="latin-1")
    assert stated_unit(tmp_path / "a.igs", "iges") == unit
    assert stated_unit(tmp_path / "a.igs", "brep") is None
