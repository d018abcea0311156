"""A project's file: wrong ones are one sentence with file and key; commands take its values."""

from pathlib import Path

import pytest

from iriftrace.cli import main
from iriftrace.cli.program import app
from iriftrace.cli.project_file import read_project_file
from iriftrace.cli.sections import key_of, keyed
from iriftrace.core.errors import InputError
from iriftrace.project.run import defaults_of
from validation.inputs import hot_block

TEXT = """
example = ["part.hot_temperature"]
[part]
mesh = "part.stl"
hot_temperature = ["1050 degC", "lateral=900 degC"]
[air]
ambient = "22 degC"
[air.simulate]
floor = "-16 mm"
[camera]
origin = [150, -100, 120]
focus = "50:300"
[[feature]]
region = "lateral"
nominal = "27 mm"
tolerance = "-0.02 0.02 mm"
[uncertainty]
wall = "10 K"
"""


def read(folder: Path, text: str) -> str:
    """The sentence about a file."""
    path = folder / "iriftrace.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as raised:
        read_project_file(path, app)
    return str(raised.value).removeprefix(f"{path}")


def test_values_are_those_of_the_options(tmp_path: Path) -> None:
    path = tmp_path / "iriftrace.toml"
    path.write_text(TEXT, encoding="utf-8")
    file = read_project_file(path, app)
    assert file.texts("camera", "origin") == ["150", "-100", "120"]
    assert file.texts("feature", "feature") == ["cylinder:lateral"]
    assert file.texts("feature", "tolerance") == ["cylinder:lateral=27 -0.02 0.02 mm"]
    assert file.texts("uncertainty", "uncertainty") == ["wall 10 K"]
    assert file.example == ("part.hot_temperature",)


_FRING = ', [second] system: Invalid value "fring" for system. Choose from: "stereo", "fringe"'


@pytest.mark.parametrize(
    ("right", "wrong", "sentence"),
    [
        ("ambient", "ambiant", ": [air] has no key ambiant; did you mean ambient?"),
        ("[camera]", "[kamera]", ": it has no key kamera; did you mean camera?"),
        ("wall =", "wal =", ": [uncertainty] has no key wal; did you mean wall?"),
        ("nominal", "nominl", ": [feature] has no key nominl; did you mean nominal?"),
        ("22 degC", "22", ", [air] ambient: '22' is a temperature without a unit"),
        ("22 degC", "22 mm", ", [air] ambient: '22 mm' cannot be converted to kelvin"),
        ("10 K", "10 mm", ", [uncertainty]: Among the uncertainties wall is '10 mm'"),
        ("[150, -100, 120]", "[150, -100]", ', [camera] origin: "150,-100" is not 3 numbers'),
        ("focus", 'calibration = "a.yml"\nsensor = "5 mm,5 mm"\nfocus', ", [camera] sensor: "),
        ("focus", 'scale = "1 mm"\nfocus', ", [camera] scale: Invalid value for scale: unable to"),
        ("[camera]", '[second]\nsystem = "fring"\n[camera]', _FRING),
        ('floor = "-16 mm"', 'draught_from = "90"', ", [air.simulate] draught_from: "),
        ('tolerance = "-0.02 0.02 mm"', "", ", [feature] tolerance: a tolerance needs both"),
        ("part.hot", "part.hott", ": example names part.hott_temperature"),
        (
            "[camera]",
            "[air.synthetic]\n[camera]",
            ", [air]: [air.simulate] and [air.synthetic] are",
        ),
        (
            "[camera]\norigin = [150, -100, 120]",
            '[sweep]\nfocal_length = "16 mm"\n[camera]\npose = "plan"',
            ", [sweep] focal_length: the best pose would be for this focal length",
        ),
        ('"22 degC"', "22 degC", " cannot be read as TOML"),
    ],
)
def test_a_wrong_file_is_one_sentence_with_file_and_key(
    right: str, wrong: str, sentence: str, tmp_path: Path
) -> None:
    assert right in TEXT
    assert read(tmp_path, TEXT.replace(right, wrong)).startswith(sentence)


def test_examples_decide_nothing_in_a_command_either(tmp_path: Path) -> None:
    path = tmp_path / "iriftrace.toml"
    for text, expected in (
        (TEXT, None),
        (TEXT.replace('"part.hot_temperature"', ""), ["cylinder:lateral=27 -0.02 0.02 mm"]),
    ):
        path.write_text(text, encoding="utf-8")
        with defaults_of(read_project_file(path, app)):
            _, bound, _ = app.parse_args(
                ["correct", "cloud.ply", "scene.xml", "-o", "c.ply"],
                exit_on_error=False,
                print_error=False,
            )
        assert bound.arguments["answers"].tolerance == expected
        assert bound.arguments["devices"].feature == ["cylinder:lateral"]


def test_commands_in_the_folder_take_values_that_they_are_not_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    field, part = hot_block.save(tmp_path)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "iriftrace.toml").write_text('[air]\nambient = "30 degC"\n[shells]\nlayers = 3\n')
    words = ["scene", str(field), str(part), *hot_block.CAMERA]
    assert main([*words, "-o", "a/scene.xml"]) == 0
    said = capsys.readouterr().out
    assert "From iriftrace.toml: [air] ambient; [shells] layers." in said
    assert "3 shells" in said
    assert "at 30 degC" in said
    assert main([*words, "-o", "b/scene.xml", "--layers=2"]) == 0
    said = capsys.readouterr().out
    assert "From iriftrace.toml: [air] ambient." in said
    assert "2 shells" in said
    (tmp_path / "iriftrace.toml").write_text('[air]\nambiant = "30 degC"\n')
    assert main([*words, "-o", "c/scene.xml"]) == 2
    assert "did you mean ambient?" in capsys.readouterr().err
    assert not Path("c").exists()


def test_every_option_of_a_fit_is_a_key(tmp_path: Path) -> None:
    arguments = app["fit"].assemble_argument_collection()
    keys = {key for _, key, _, _ in keyed("fit", arguments)}
    options = {key_of(one) for one in arguments if one.parse and not one.children}
    assert options - keys == {"board", "measured", "output", "scene"}
    path, board = tmp_path / "iriftrace.toml", '[board]\nfree = ["contrast", "lean"]\n'
    for view in (
        '["a.xml", "a.csv", "b.xml", "b.csv"]',
        '[["a.xml", "a.csv"], ["b.xml", "b.csv"]]',
    ):
        path.write_text(f"{TEXT}{board}view = {view}", encoding="utf-8")
        with defaults_of(read_project_file(path, app)):
            _, bound, _ = app.parse_args(["fit", "s.xml", "s.csv", "-o", "f.xml"])
        assert bound.arguments["free"] == "contrast,lean"
        files = [tuple(map(str, one)) for one in bound.arguments["view"]]
        assert files == [("a.xml", "a.csv"), ("b.xml", "b.csv")]
    said = read(tmp_path, f'{TEXT}{board}view = ["a.xml"]')
    assert said == ", [board] view: a list of 1 is given, but 2 belong together; write lists of 2."
