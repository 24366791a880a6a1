"""Make the pictures and animations of README and docs: ``python docs/make_figures.py [NAME ...]``.

A name is an example's, such as 03, or ``mathematics``; without names all are made (minutes). What was planned for a
picture is kept in figures/gallery.json, from which make_pages.py writes the gallery.
"""

from __future__ import annotations

import importlib.util
import io
import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType

import yaml
from make_mathematics_figures import mathematics
from make_pages import GALLERY, write_gallery
from matplotlib.figure import Figure
from PIL import Image

import brachis
from brachis.apps.comparison import plot_both_motions
from brachis.apps.plots import (
    plot_candidates,
    plot_comparison,
    plot_fit,
    plot_limits,
    plot_overview,
    plot_postures,
    plot_timeline,
    plot_torques,
)
from brachis.task import Tolerances

ROOT = Path(__file__).parents[1]
FIGURES = ROOT / "docs/figures"
DOTS_PER_INCH = 150
COLOURS = 128
PERIOD = 0.05  # s
RAIL_LINE = "examples/03_tx90l_rail_line.yaml"

Planned = Mapping[str, brachis.Result]


def load(path: str) -> ModuleType:
    """Import a Python file of the repository."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, ROOT / path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def save(figure: Figure, name: str) -> None:
    """Write a small PNG for a page; figures for print are what `brachis.plots.save_figure` writes."""
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=DOTS_PER_INCH)
    Image.open(content).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(
        FIGURES / f"{name}.png", optimize=True
    )


def animate(result: brachis.Result, name: str, slower: float = 1.0) -> None:
    """Write a GIF, as ``brachis export --slower`` does."""
    brachis.export.write(result, FIGURES / f"{name}.gif", dt=PERIOD, slower=slower)


def planned(name: str) -> brachis.Result:
    """Plan an example's task file."""
    return brachis.plan(ROOT / f"examples/{name}.yaml")


def scara_line() -> Planned:
    """Draw the paper's line."""
    result = planned("01_scara_line")
    save(plot_overview(result.trajectory), "scara_line")
    animate(result, "scara_line")
    return {"j3": result}


def scara_table() -> Planned:
    """Draw the paper's table."""
    results = load("examples/02_scara_table.py").plan_all()
    rows = [
        (float(angle), joint, each.t_end) for (angle, joint), each in results.items()
    ]
    save(
        plot_comparison(rows, "direction of the path", "\N{DEGREE SIGN}"), "scara_table"
    )
    return {
        f"{angle} deg, {joint}": each
        for (angle, joint), each in results.items()
        if angle == 90
    }


def tx90l_rail() -> Planned:
    """Draw the industrial arm on its rail."""
    result = brachis.plan(ROOT / RAIL_LINE)
    save(plot_timeline(result.trajectory), "timeline")
    save(plot_overview(result.trajectory), "tx90l_rail")
    animate(result, "tx90l_rail", slower=10.0)
    return {"rail": result}


def ur10_weld() -> Planned:
    """Draw a welding seam."""
    result = planned("04_ur10_rail_weld")
    save(plot_overview(result.trajectory), "ur10_weld")
    return {"rail": result}


def panda_circle() -> Planned:
    """Animate one of four motions of a seven-joint arm."""
    results = load("examples/05_panda_circle.py").main()
    animate(results["panda_joint7"], "panda_circle", slower=5.0)
    return results


def free_roll() -> Planned:
    """Draw the fastest of three ways to turn a tool."""
    results = load("examples/06_free_roll.py").main()
    save(plot_overview(results["free roll"].trajectory), "free_roll")
    return results


def fastest() -> Planned:
    """Draw all candidates of a search."""
    result = planned("07_find_the_fastest")
    save(plot_candidates(result.candidates), "candidates")
    return {"auto": result}


def cam_seam() -> Planned:
    """Draw how near a path is to points as CAM gives them."""
    result = load("examples/08_cam_seam.py").main()
    save(plot_fit(result.trajectory), "cam_seam")
    return {"seam": result}


def payload() -> Planned:
    """Draw the motion with all that a task may say of a robot."""
    results = load("examples/09_payload_friction_jerk.py").main()
    save(plot_limits(list(results.values())[-1].trajectory), "payload")
    return results


def periodic() -> Planned:
    """Draw a circle that is gone round for ever."""
    results = load("examples/10_periodic_circle.py").main()
    save(plot_overview(results["periodic"].trajectory), "periodic_circle")
    animate(results["periodic"], "periodic_circle")
    return results


def joint_path() -> Planned:
    """Draw the limits along a path of joints."""
    result = planned("11_from_toppra")
    save(plot_limits(result.trajectory), "joint_path")
    return {"brachis": result}


def today() -> Planned:
    """Draw a motion that runs today beside the one that is planned along its path."""
    found = load("examples/12_today.py").main()
    save(plot_both_motions(found), "today")
    return {"planned": found.result}


def weld_seams() -> Planned:
    """Animate two seams with a spot between them."""
    result = planned("13_weld_seams")
    animate(result, "weld_seams", slower=3.0)
    return {"rail": result}


def round_the_post() -> Planned:
    """Animate a motion that goes round a post, with the smallest distance over time."""
    result = planned("14_round_the_post")
    animate(result, "round_the_post", slower=5.0)
    task = brachis.load_task(ROOT / "examples/14_round_the_post.yaml")
    return {"round the post": result, "without a scene": brachis.plan(task, scene=())}


def tilted_torch() -> Planned:
    """Animate a motion whose tool may tilt."""
    result = planned("15_tilted_torch")
    animate(result, "tilted_torch", slower=20.0)
    task = brachis.load_task(ROOT / "examples/15_tilted_torch.yaml")
    fixed = brachis.plan(task, tolerances=Tolerances())
    return {"tilt up to 15 degrees": result, "no tilt": fixed}


def into_the_car_body() -> Planned:
    """Animate a motion through a window, with the smallest distance over time."""
    result = planned("16_into_the_car_body")
    animate(result, "into_the_car_body", slower=5.0)
    return {"through the window": result}


def deburring_cycle() -> Planned:
    """Animate a closed cycle over two edges."""
    result = planned("17_deburring_cycle")
    animate(result, "deburring_cycle", slower=3.0)
    return {"cycle": result}


def pick_and_place() -> Planned:
    """Animate a box that is carried over a wall."""
    result = planned("18_pick_and_place")
    animate(result, "pick_and_place", slower=3.0)
    return {"cycle": result}


def order_of_welds() -> Planned:
    """Animate welds in the best order."""
    result = planned("19_order_of_welds")
    animate(result, "order_of_welds", slower=3.0)
    task = brachis.load_task(ROOT / "examples/19_order_of_welds.yaml")
    return {"best order": result, "as listed": brachis.plan(_as_listed(task))}


def _as_listed(task: brachis.Task) -> brachis.Task:
    """Return the task with its paths in the order of the file."""
    moves = [{"move": "next"} for _ in task.program]
    parts = [each for pair in zip(moves, task.program, strict=True) for each in pair]
    changed = {"order": "given", "program": [*parts, {"move": "home"}]}
    return brachis.load_task({**task.to_dict(), **changed})


def positioner() -> Planned:
    """Animate a tube that turns under the torch."""
    result = planned("20_positioner")
    animate(result, "positioner", slower=5.0)
    return {"tilt and turn": result}


def crane() -> Planned:
    """Draw the motion with a plug-in's closed form."""
    family = load("examples/ik_plugin/src/brachis_polar/__init__.py").polar
    result = brachis.plan(ROOT / "examples/ik_plugin/crane.yaml", families=[family])
    save(plot_postures(result.trajectory), "crane")
    return {"crane": result}


def coupled() -> Planned:
    """Draw the motion with a plug-in's limit, which is given as an object here."""
    limit = load("examples/limit_plugin/src/brachis_coupled/__init__.py").CoupledRange
    task = yaml.safe_load((ROOT / "examples/limit_plugin/coupled.yaml").read_text())
    task["robot"]["urdf"] = str(ROOT / "robots/scara3/robot.urdf")
    (settings,) = task.pop("custom_limits").values()
    result = brachis.plan(task, own_limits=[limit(**settings)])
    save(plot_torques(result.trajectory), "coupled")
    return {"coupled": result}


EXAMPLES: dict[str, Callable[[], Planned]] = {
    "01": scara_line,
    "02": scara_table,
    "03": tx90l_rail,
    "04": ur10_weld,
    "05": panda_circle,
    "06": free_roll,
    "07": fastest,
    "08": cam_seam,
    "09": payload,
    "10": periodic,
    "11": joint_path,
    "12": today,
    "13": weld_seams,
    "14": round_the_post,
    "15": tilted_torch,
    "16": into_the_car_body,
    "17": deburring_cycle,
    "18": pick_and_place,
    "19": order_of_welds,
    "20": positioner,
    "ik_plugin": crane,
    "limit_plugin": coupled,
}


def main(names: list[str]) -> None:
    """Write docs/figures, and the gallery."""
    FIGURES.mkdir(exist_ok=True)
    if not names or "mathematics" in names:
        mathematics(save)
    figures = json.loads(GALLERY.read_text()) if GALLERY.exists() else {}
    for name, make in EXAMPLES.items():
        if not names or name in names:
            print(f"{name} ...", flush=True)  # noqa: T201
            results = make()
            assert all(each.verified for each in results.values()), name
            figures[name] = {key: round(each.t_end, 4) for key, each in results.items()}
    GALLERY.write_text(
        json.dumps(
            {name: figures[name] for name in EXAMPLES if name in figures}, indent=1
        )
        + "\n"
    )
    write_gallery()


if __name__ == "__main__":
    main(sys.argv[1:])
