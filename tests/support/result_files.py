"""Result files that are not what was saved."""

from __future__ import annotations

import json

import numpy as np


def with_parts(path, **parts):
    """Rewrite a result file with other parts; ``task__robot__urdf`` is meta["task"]["robot"]["urdf"]."""
    with np.load(path) as archive:
        contents = dict(archive)
    meta = json.loads(str(contents["meta"]))
    for name, value in parts.items():
        change = value if callable(value) else (lambda _old, value=value: value)
        if name in contents:
            contents[name] = change(contents[name])
            continue
        place = meta
        *parents, last = name.split("__")
        for parent in parents:
            place = place[parent]
        place[last] = change(place.get(last))
    if "meta" not in parts:
        contents["meta"] = np.array(json.dumps(meta))
    np.savez(
        path, **{name: value for name, value in contents.items() if value is not None}
    )
    return path
