"""What the command line says of points that a path follows."""

import json

import numpy as np
import pytest

from support.effort import QUICK


@pytest.fixture
def seam(task, write, tmp_path):
    """A task along points that scatter by 0.02 mm, in mm with decimal commas."""
    y = np.linspace(0.0, 600.0, 1_500)
    x = 1732.0508 + 20.0 * np.sin(y / 100.0)
    scatter = np.random.default_rng(5).normal(size=(2, 1_500)) * 0.02
    rows = (
        f"{a:.4f};{b:.4f}".replace(".", ",")
        for a, b in zip(x + scatter[0], y + scatter[1], strict=True)
    )
    (tmp_path / "seam.csv").write_text("\n".join(["x_mm;y_mm", *rows]))
    task["path"] = [{"csv": {"file": "seam.csv", "tolerance": {"position": "0.12 mm"}}}]
    return write({**task, "start": "free", "redundant_joints": ["j1"], "search": QUICK})


def test_inspect_reports_the_fit_of_points(run, seam):
    shown = run(f"inspect {seam}").out
    for words in ("seam.csv", "1500 points along", "decimal commas", "semicolons"):
        assert words in shown
    for words in ("length in mm", "scatter by", "0.12 mm"):
        assert words in shown
    (fit,) = run(f"inspect {seam} --json").data["fits"]
    assert fit["position_error"] <= 0.12e-3
    assert fit["corners"] == []


def test_plan_reports_and_draws_the_fit(run, seam, tmp_path):
    assert "path from seam.csv: 1500 points" in " ".join(
        run(f"plan {seam} --out {tmp_path / 'out'}").out.split()
    )
    (fit,) = json.loads((tmp_path / "out/result.json").read_text())["fits"]
    assert 0.0 < fit["position_rms"] < fit["position_error"] <= 0.12e-3
    assert (tmp_path / "out/fit.png").read_bytes().startswith(b"\x89PNG")
    figure = tmp_path / "again.svg"
    run(f"plot {tmp_path / 'out/result.npz'} --kind fit --out {figure}")
