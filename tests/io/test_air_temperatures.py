"""Tables of thermocouples: their columns, units, and what is refused."""

from pathlib import Path

import pytest
from numpy.testing import assert_allclose

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.air_temperatures import is_air_temperatures, read_air_temperatures


@pytest.mark.parametrize(
    "text",
    [
        "x,y,z,T (degC),U\n1.5,2,3,100,4\n",
        "X [mm]\tY [mm]\tZ [mm]\tTemperature [°C]\tU [K]\n1,5\t2,0\t3,0\t100,0\t4,0\n",
        "x (m);y (m);z (m);T (K);U\n0,0015;0,002;0,003;373,15;4\n",
        "# x y z T [K] U\n1.5 2 3 373.15 4\n",
        "# thermocouples, hall 3\n# 2025-03-04\n\nx,y,z,T (degC),U\n1.5,2,3,100,4\n",
        "# unit: m\nx,y,z,T (degC),U\n0.0015,0.002,0.003,100,4\n",
        "x;y;z;T_degC;U [K];\n1.5;2;3;100;4;\n;;;;;\n# checked by hand\n",
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "cp1252", "utf-16"])
def test_names_and_units(tmp_path: Path, text: str, encoding: str) -> None:
    path = tmp_path / "air.csv"
    path.write_text(text, encoding=encoding)
    assert is_air_temperatures(path)
    found = read_air_temperatures(path)
    assert_allclose(found.places, [(1.5, 2.0, 3.0)])
    assert_allclose(found.kelvins, [373.15])
    assert_allclose(found.deviations, [2.0])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x,y,z,T\n1,2,3,100\n", r"air of 100 K, as T is read in K.*T \(degC\)"),
        ("x,y,z,T (K),U (mK)\n1,2,3,400,4\n", "U in mK and T in K"),
        ("x,y,z,T (degC)\n1,2,3,90\n1,2,4,9999\n", r"air of 1\.027e\+04 K.* that are open"),
        ("x,y,z,T (degC),T (K)\n1,2,3,90,363\n", "several columns T"),
        ("x,y,z,T (degC)\n1,2,3,90\n1,2,4,#N/A\n", "not finite"),
        ("x,y,z,T (K),U\n1,2,3,290,2\nMean,2,3,290,2\n", "line 3: 'Mean' is not a number"),
        ("t,x,y,z,T (degC)\n0,1,2,3,90\n1,1,2,3,95\n", "several temperatures at one place"),
    ],
)
def test_other_units_are_refused(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "air.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        read_air_temperatures(path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x,y,z,T,U\n1,2,3,290,4\n1,2,4,620,4\n", r"unit of T.* in K \(17 to 347 degC\)"),
        ("x,y,z,T (K),u_T\n1,2,3,290,2\n", "column u_T, which is not read.*expanded one"),
    ],
)
def test_doubtful_columns_and_rows_are_warned_of(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "air.csv"
    path.write_text(text)
    with pytest.warns(IriftraceWarning, match=words):
        assert read_air_temperatures(path).kelvins.min() == 290.0
