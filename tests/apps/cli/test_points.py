"""What the command line says of points that a path follows."""

import json


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
