"""How much time payload, friction, a jerk limit and a speed override cost, added one by one."""

from __future__ import annotations

from pathlib import Path

import brachis

TASK = Path(__file__).with_suffix(".yaml")
LEFT_OUT = {
    "the arm alone": ("payload", "friction", "limits.jerk", "speed_override"),
    "with payload": ("friction", "limits.jerk", "speed_override"),
    "and friction and rotors": ("limits.jerk", "speed_override"),
    "and bounded jerk": ("speed_override",),
    "and the speed override": (),
}


def main() -> dict[str, brachis.Result]:
    """Plan all variants, and print their end times and the settings in use."""
    results = {}
    for name, left_out in LEFT_OUT.items():
        task = brachis.load_task(TASK).to_dict()
        for key in left_out:
            *part, last = key.split(".")
            del (task["robot"][part[0]] if part else task["robot"])[last]
        result = results[name] = brachis.plan(task)
        print(f"{name}: {result.t_end:.3f} s, verified: {result.verified}")
    for name, text in result.to_dict()["in_use"].items():
        print(f"  {name}: {text}")
    return results


if __name__ == "__main__":
    main()
