"""The package over the program that LUXPROOF names; `ci/python` runs it."""

from __future__ import annotations

import importlib.resources
import subprocess
from pathlib import Path

import luxproof
import nbformat
import pytest
from nbclient import NotebookClient

REFERENCE = Path(__file__).parents[2] / "reference"


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> luxproof.Report:
    out = tmp_path_factory.mktemp("run") / "out"
    spec = REFERENCE / "specs" / "axial.yaml"
    return luxproof.run(spec, engines=["simulator", "iesna"], out=out, options=["--no-calibration", "--no-cache"])


def test_a_run_is_what_load_reads(report: luxproof.Report) -> None:
    assert report.folder is not None
    again = luxproof.load(report.folder)
    assert again.data == report.data == luxproof.load(report.folder / "report.json").data
    assert report.summary["pass"] > 0 and report.title


def test_tables_hold_every_entry_and_say_their_units(report: luxproof.Report) -> None:
    comparisons = report.comparisons
    assert len(comparisons) == len(report.data["comparisons"])
    assert comparisons.attrs["units"]["gamma_deg"] == "deg"
    first = report.data["comparisons"][0]
    assert comparisons.loc[0, "reference.value"] == first["reference"]["value"]
    passed = comparisons[comparisons.verdict == "pass"]
    assert len(passed) == report.summary["pass"]
    assert len(report.readings) == len(report.data["readings"])
    assert list(report.statistics.columns[:5]) == ["case", "procedure", "engine", "set", "meters"]
    assert isinstance(report.bias.columns[0], str)


def test_statistics_are_those_of_the_readings(report: luxproof.Report) -> None:
    readings, statistics = report.readings, report.statistics
    readings = readings[readings.quantity == "illuminance_lx"]
    readings = readings.assign(set=readings.meter.str.rsplit("[", n=1).str[0])
    mean = readings.groupby(["procedure", "engine", "set"]).value.mean()
    assert len(statistics) > 0
    for row in statistics.to_dict("records"):
        assert row["mean.value"] == pytest.approx(mean[row["procedure"], row["engine"], row["set"]], rel=1e-12)


def test_comparisons_come_one_at_a_time_and_lines_that_are_missing_are_told(report: luxproof.Report, tmp_path: Path) -> None:
    assert report.folder is not None
    assert list(luxproof.each_comparison(report.folder)) == report.data["comparisons"]
    spec = tmp_path / "spec.yaml"
    (tmp_path / "lamp.ies").write_bytes((REFERENCE / "luminaires" / "isotropic.ies").read_bytes())
    spec.write_text("""luxproof: 1
room: {size_m: [50, 20, 5], reflectance: {floor: 0.2, walls: 0.5, ceiling: 0.7}}
luminaires:
  - {id: lamp, photometry: lamp.ies, at_m: [24.3, 9.1, 4.5]}
meters:
  plane: {grid: {origin_m: [0.05, 0.05, 0.8], u_m: [0.45, 0, 0], v_m: [0, 0.19, 0], counts: [110, 100]}, normal: [0, 0, 1]}
procedures:
  direct_illuminance: {meters: plane}
""")
    long = luxproof.run(spec, engines=["simulator", "iesna"], out=tmp_path / "out", options=["--no-calibration", "--no-cache"])
    lines = tmp_path / "out" / "comparisons.jsonl"
    assert list(luxproof.each_comparison(tmp_path / "out")) == list(luxproof.each_comparison(lines)) == long.data["comparisons"]
    sound = lines.read_bytes()
    for damaged, says in [
        (sound[:-1], "ends early"), (sound[: len(sound) // 2], "ends early"), (sound + b"{}\n", "11001 comparisons of 11000"),
        (sound.replace(b'"verdict":"pass"', b'"verdict":"fail"', 1), "damaged"), (sound.split(b"\n", 1)[1], "does not begin"),
        (b"", "does not begin"), (sound.replace(b'"report":"', b'"report":"0', 1), "of another report"),
    ]:
        lines.write_bytes(damaged)
        with pytest.raises(ValueError, match=says):
            list(luxproof.each_comparison(lines))


def test_photometry_is_one_row_a_file() -> None:
    lamps = [REFERENCE / "luminaires" / name for name in ("isotropic.ies", "lambertian-point.ies")]
    table = luxproof.photometry(*lamps)
    assert list(table.file) == [str(lamp) for lamp in lamps]
    assert (table.flux_lm > 0).all() and table.attrs["units"]["max_cd"] == "cd"


def test_what_the_program_refuses_is_raised_with_its_place(tmp_path: Path) -> None:
    spec = tmp_path / "spec.yaml"
    spec.write_text("luxproof: 1\nroom: {size_m: [1, 2, three]}\n")
    with pytest.raises(luxproof.LuxproofError, match=r"spec.yaml:2:23"):
        luxproof.run(spec)
    with pytest.raises(ValueError, match="no report"):
        file = tmp_path / "x.json"
        file.write_text("{}")
        luxproof.load(file)


def test_the_package_is_typed() -> None:
    assert importlib.resources.files(luxproof).joinpath("py.typed").is_file()
    assert luxproof.version()[0].isdigit()


TABLE = """luxproof_published: 1
citation: {title: A paper}
spec: spec.yaml
rounding: {units_in_last_digit: 1}
tables:
  direct_illuminance:
    name: Table 1
    quantity: illuminance_lx
    columns: {inverse_square: {reference: true, engine: iesna, model: point, meaning: by hand}}
    rows: [{at_m: [2, 2, 0.5], normal: [0, 0, 1], cells: {inverse_square: "VALUE"}}]
"""


def test_a_papers_cells_and_a_bundles_rows_are_tables(tmp_path: Path) -> None:
    lamp = REFERENCE / "luminaires" / "lambertian-point.ies"
    (tmp_path / "lamp.ies").write_bytes(lamp.read_bytes())
    (tmp_path / "spec.yaml").write_text(
        "luxproof: 1\nroom: {size_m: [4, 4, 3], reflectance: {floor: 0, walls: 0, ceiling: 0}}\n"
        "luminaires: [{id: lamp, photometry: lamp.ies, at_m: [2, 2, 2.5]}]\n"
        "meters: {floor: {points_m: [[2, 2, 0.5]], normal: [0, 0, 1]}}\n"
        "procedures: {direct_illuminance: {meters: floor}}\npublished: table.yaml\n"
    )
    candela = float(luxproof.photometry(lamp).loc[0, "max_cd"])
    for shift, standing in [(0.0, "reproduced"), (1.0, "not_reproduced")]:
        (tmp_path / "table.yaml").write_text(TABLE.replace("VALUE", f"{candela / 4 + shift:.2f}"))
        cells = luxproof.reproduce(tmp_path / "table.yaml", out=tmp_path / "out")
        assert list(cells.standing) == [standing]
    subprocess.run([luxproof.program(), "bundle", str(tmp_path / "out"), "--out", str(tmp_path / "bundle")], check=True, capture_output=True)
    rows = luxproof.reproduce(tmp_path / "bundle", out=tmp_path / "again")
    assert len(rows) == 2 and set(rows.outcome) == {"same_bytes"}
    (tmp_path / "bundle" / "added").touch()
    with pytest.raises(luxproof.LuxproofError, match="added was added"):
        luxproof.reproduce(tmp_path / "bundle", out=tmp_path / "again")


NOTEBOOKS = sorted((REFERENCE.parent / "docs" / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_of_the_guide_runs_and_keeps_no_output(path: Path, tmp_path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert all(cell.outputs == [] and cell.execution_count is None for cell in cells), f"{path} keeps outputs: strip them"
    client = NotebookClient(notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(path.parent)}})
    client.execute()
    images = [output for cell in cells for output in cell.outputs if "image/png" in output.get("data", {})]
    assert images, "it plots nothing"
    texts = "".join(output.get("text", "") for cell in cells for output in cell.outputs)
    assert "12 printed cells" in texts, texts
