"""Notebooks in docs/notebooks: each runs to its end, with short parameters, and is stored without outputs."""

from __future__ import annotations

import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

pytestmark = pytest.mark.extended

FOLDER = Path(__file__).resolve().parent.parent / "docs/notebooks"
PARAMETERS = {
    "tune-for-a-part": 'path = "corner-45"\ndesigns = 50\nmachines = 64',
    "sensitivity": "machines = 400\nworkers = 2",
    "residual-policy": 'seconds = 3\nmotion = "corner-90"',
}


def executed(name: str, folder: Path) -> str:
    """Executes a notebook in a folder and returns its text outputs; raises if a cell fails."""
    notebook = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
    for cell in notebook.cells:
        if "parameters" in cell.metadata.get("tags", []) and name in PARAMETERS:
            cell.source = PARAMETERS[name]
    NotebookClient(
        notebook, timeout=400, kernel_name="python3", resources={"metadata": {"path": str(folder)}}
    ).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    texts = [output.get("text") or output.get("data", {}).get("text/plain", "") for output in outputs]
    return "\n".join(texts)


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_is_stored_without_outputs(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    assert all(not cell.outputs for cell in notebook.cells if cell.cell_type == "code")
    assert path.name in (FOLDER / "index.md").read_text(encoding="utf-8")


def test_the_predictive_controller_has_smaller_errors_and_margins(tmp_path: Path) -> None:
    text = executed("compare-controllers", tmp_path)
    lines = (re.fullmatch(r"(.*?)\s{2,}([\d.]+)\s+([\d.]+)", line) for line in text.splitlines())
    rows = {line[1]: (float(line[2]), float(line[3])) for line in lines if line}
    for row in ("contour error, max", "contour error, RMS", "modulus"):
        cascade, gpc = rows[row]
        assert cascade > gpc > 0, rows


def test_the_identified_machine_has_inertia_and_weight_of_the_tutorial() -> None:
    # Jupyter runs a notebook in its folder, from which this one finds the recordings.
    text = executed("identify-from-a-trace", FOLDER)
    tutorial = (FOLDER.parent / "tutorials/identify-from-a-trace.md").read_text(encoding="utf-8")
    for key in ("z.motor.inertia_kg_m2", "z.gravity.weight_n"):
        value = re.search(rf"^{re.escape(key)} +([\d.]+)", tutorial, re.MULTILINE)
        assert value is not None
        row = next(line for line in text.splitlines() if f" {key} " in line)
        assert float(value[1]) in [float(word) for word in row.split() if re.fullmatch(r"[\d.]+", word)], row
    assert "invalid: " not in text


def test_a_tuning_has_smaller_errors_on_its_path(tmp_path: Path) -> None:
    text = executed("tune-for-a-part", tmp_path)
    row = re.search(r"^corner-45 +([\d.]+) +([\d.]+)$", text, re.MULTILINE)
    assert row is not None and float(row[2]) < 0.1 * float(row[1]), text
    median, largest = map(float, re.findall(r"([\d.]+) µm", text)[-2:])
    assert float(row[2]) < median < largest


def test_the_shares_of_a_sensitivity_study_add_up(tmp_path: Path) -> None:
    text = executed("sensitivity", tmp_path)
    shares = {key: float(value) for key, value in re.findall(r"'([\w.]+)': (-?[\d.]+)", text.split("count")[-1])}
    assert len(shares) == 7 and sum(shares.values()) == pytest.approx(1.0, abs=0.005)
    assert shares["rest"] < 0.5


def test_training_reduces_the_contour_error(tmp_path: Path) -> None:
    text = executed("residual-policy", tmp_path)
    without, trained = map(float, re.findall(r"([\d.]+) µm", text))
    assert trained < without - 1.0, text
