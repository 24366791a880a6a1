"""The ablation switches mechanisms off that exist, and finds out which ones a task uses.

The full count is `benchmarks/ablation.py`.
"""

import pkgutil
from dataclasses import replace

import pytest

from brachis.robot.from_task import robot_for


def test_every_mechanism_exists(bench):
    """A mechanism that went takes its row of the ablation with it."""
    missing = []
    for mechanism in bench("ablation_mechanisms").MECHANISMS:
        for name in (mechanism.recorded, *mechanism.patches):
            try:
                pkgutil.resolve_name(name)
            except (AttributeError, ImportError):
                missing.append(f"{mechanism.name}: {name}")
    assert not missing


def weaken(name, settings):
    limits = replace(settings.limits, torque={"x_axis": 2.5})
    return robot_for(name, settings.model_copy(update={"limits": limits}))


def test_plans_without_a_mechanism(bench, tmp_path, monkeypatch):
    """Only used mechanisms are switched off, the file is resumed, and what a mechanism gains is found."""
    ablation = bench("ablation")
    module = bench("ablation_mechanisms")
    nothing = module.find("nothing")
    strong = module.Mechanism("strong", "", {"brachis.planner.robot_for": weaken})
    unused = module.Mechanism("unused", "", {"brachis.planner.try_remedies": weaken})
    mechanisms = [nothing, strong, unused]
    monkeypatch.setattr(ablation, "MECHANISMS", mechanisms)
    (task,) = ablation.choose_tasks(None, ["slide 5 N, velocity"])
    out = tmp_path / "plans.jsonl"
    lines = ablation.run([task], mechanisms, out, most=60.0)
    assert [without for _, without in lines] == ["", "nothing", "strong"]
    text = out.read_text(encoding="utf-8")
    assert ablation.run([task], mechanisms, out, most=60.0) == lines
    assert out.read_text(encoding="utf-8") == text
    row = ablation.summarise(lines, "strong", [task.name])
    # By a constant acceleration the time goes with the root of the force.
    assert float(row[2]) == pytest.approx(2.0**0.5, rel=1e-3)
    assert row[-1] == "stays"
    assert float(ablation.summarise(lines, "nothing", [task.name])[2]) == 1.0
