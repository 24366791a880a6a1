"""The scene in space: robot, ghost postures, path, tool trace, frames and ground."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.apps.plots.postures import plane_of
from brachis.apps.view.bodies import Bodies, Motion, Placements, placements

if TYPE_CHECKING:
    import viser

    Layer = list[viser.SceneNodeHandle]

LAYERS = (
    "robot",
    "skeleton",
    "ghost postures",
    "path",
    "tool trace",
    "tool frame",
    "world frame",
    "ground",
)
"""What can be shown and hidden."""
_GHOST_FIRST = np.array([190.0, 214.0, 235.0])
_GHOST_LAST = np.array([25.0, 75.0, 125.0])
_SHADES = 32
"""Colours of the trace."""
_FINE = 2000
"""Faces of a mesh that is drawn as its convex hull where it is a ghost."""
_PATH = (30, 30, 30)
_START = (0, 158, 115)
_END = (213, 94, 0)
_FIELD_OF_VIEW = 0.75
"""rad."""
_ROOM = 1.35
"""Distance of the camera, as a multiple of the one from which the motion fills the height of the picture."""
_SIDE = np.radians(50.0)
"""From the direction in which the arm reaches to where it is looked at from, in the ground plane."""


class Scene:
    """A robot and its motion in the browser.

    Parameters
    ----------
    server : viser.ViserServer
    motion : Motion
    bodies : Bodies
    """

    def __init__(
        self, server: viser.ViserServer, motion: Motion, bodies: Bodies
    ) -> None:
        self._api = server.scene
        self._motion = motion
        self._bodies = bodies
        self._api.configure_environment_map(
            None
        )  # a plain light shows pale robots on the white page better
        self._api.add_light_hemisphere(
            "/light",
            sky_color=(255, 255, 255),
            ground_color=(120, 120, 130),
            intensity=2.0,
        )
        self._robot = motion.trajectory.robot
        self._size = float(np.linalg.norm(bodies.moving_upper - bodies.moving_lower))
        self.layers: dict[str, Layer] = {name: [] for name in LAYERS}
        self._frames = [
            self._api.add_frame(f"/joint {k}", show_axes=False)
            for k in range(self._robot.n + 1)
        ]
        self._tool = self._frame("/tool", 0.1)
        self.layers["tool frame"].append(self._tool)
        self.layers["world frame"].append(self._frame("/world", 0.15))
        self._draw_bodies()
        self._draw_ghosts()
        self._draw_path()
        self._draw_trace()
        self.cell = self._draw_ground()
        for name in ("world frame", "skeleton" if bodies.shows_links else "robot"):
            self.set_visible(name, visible=False)
        self._aim(server)

    def set_visible(self, name: str, *, visible: bool) -> None:
        """Show or hide one of `LAYERS`."""
        for handle in self.layers[name]:
            handle.visible = visible

    def show(self, q: np.ndarray) -> None:
        """Move the robot into the posture `q`, (n,)."""
        found = placements(self._robot, q[None])
        for handle, position, quaternion in zip(
            (*self._frames, self._tool),
            found.positions[0],
            found.quaternions[0],
            strict=True,
        ):
            handle.position = position
            handle.wxyz = quaternion

    def _frame(self, name: str, part: float) -> viser.FrameHandle:
        """Add axes whose length is a part of the scene's size."""
        length = part * self._size
        return self._api.add_frame(
            name,
            axes_length=length,
            axes_radius=0.03 * length,
            origin_radius=0.06 * length,
        )

    def _draw_bodies(self) -> None:
        """Hang links and skeleton on the joints' frames, one asset for each."""
        import trimesh

        for layer, bodies in (
            ("robot", self._bodies.links),
            ("skeleton", self._bodies.skeleton),
        ):
            for joint, meshes in bodies.items():
                asset = trimesh.Scene(list(meshes)).export(file_type="glb")
                self.layers[layer].append(
                    self._api.add_glb(f"/joint {joint}/{layer}", asset)
                )

    def _draw_ghosts(self) -> None:
        """Draw what moves a few times, fainter, the later the darker."""
        import trimesh

        bodies = (
            self._bodies.links if self._bodies.shows_links else self._bodies.skeleton
        )
        ghosts = self._motion.ghosts
        shades = np.linspace(_GHOST_FIRST, _GHOST_LAST, len(ghosts.positions)).astype(
            np.uint8
        )
        for joint, meshes in bodies.items():
            if _still(ghosts, joint):
                continue
            coarse = [
                mesh.convex_hull if len(mesh.faces) > _FINE else mesh for mesh in meshes
            ]
            whole = trimesh.util.concatenate(
                [trimesh.Trimesh(mesh.vertices, mesh.faces) for mesh in coarse]
            )
            handle = self._api.add_batched_meshes_simple(
                f"/ghosts/{joint}",
                whole.vertices,
                whole.faces,
                batched_wxyzs=ghosts.quaternions[:, joint],
                batched_positions=ghosts.positions[:, joint],
                batched_colors=shades,
                opacity=0.13,
                cast_shadow=False,
                receive_shadow=False,
            )
            self.layers["ghost postures"].append(handle)

    def _draw_path(self) -> None:
        """Draw the prescribed path with its ends."""
        points = self._motion.path
        layer = self.layers["path"]
        layer.append(
            self._api.add_line_segments(
                "/path",
                _segments(points),
                _PATH,
                thickness=2.5,
                thickness_units="screen",
            )
        )
        for name, point, colour in (
            ("end", points[-1], _END),
            ("start", points[0], _START),
        ):
            ball = self._api.add_icosphere(
                f"/path/{name}", 0.009 * self._size, color=colour, position=point
            )
            layer.append(ball)

    def _draw_trace(self) -> None:
        """Draw the way of the tool, coloured by its speed."""
        speed = self._motion.samples.tool_speed
        segments = _segments(self._motion.frames.tool)
        parts = 0.5 * (speed[:-1] + speed[1:]) / max(float(speed.max()), 1e-9)
        shades = np.round(parts * (_SHADES - 1)).astype(int)
        colours = speed_colours(np.linspace(0.0, 1.0, _SHADES))
        for shade in np.unique(
            shades
        ).tolist():  # viser shows colours of single points lighter than they are
            lines = self._api.add_line_segments(
                f"/trace/{shade}",
                segments[shades == shade],
                colours[shade],
                thickness=7.0,
                thickness_units="screen",
            )
            self.layers["tool trace"].append(lines)

    def _draw_ground(self) -> float:
        """Draw a grid below everything; returns the size of its cells, m."""
        low = self._bodies.lower
        high = self._bodies.upper
        cell = float(10.0 ** np.round(np.log10(0.06 * self._size)))
        width, height = 10.0 * cell * np.ceil((high - low)[:2] / (10.0 * cell) + 1.0)
        centre = 10.0 * cell * np.round(0.5 * (low + high)[:2] / (10.0 * cell))
        grid = self._api.add_grid(
            "/ground",
            width=float(width),
            height=float(height),
            cell_size=cell,
            section_size=10.0 * cell,
            cell_color=(225, 225, 225),
            section_color=(170, 170, 170),
            shadow_opacity=0.2,
            position=(*centre, min(0.0, float(low[2])) - 1e-3 * self._size),
        )
        self.layers["ground"].append(grid)
        return cell

    def _aim(self, server: viser.ViserServer) -> None:
        """Look at the whole motion: a planar one at its plane, any other from the side to which the arm reaches."""
        centre = 0.5 * (self._bodies.moving_lower + self._bodies.moving_upper)
        distance = _ROOM * 0.5 * self._size / np.sin(0.5 * _FIELD_OF_VIEW)
        camera = server.initial_camera
        camera.fov = _FIELD_OF_VIEW
        camera.near = 0.005 * distance
        camera.far = 100.0 * distance
        camera.look_at = centre
        camera.position = centre + distance * self._direction()

    def _direction(self) -> np.ndarray:
        """Return the unit vector from the scene to the camera, (3,)."""
        trajectory = self._motion.trajectory
        plane = plane_of(trajectory)
        if plane is None:
            base = self._motion.frames.positions[:, 1].mean(axis=0)
            tool = self._motion.frames.tool.mean(axis=0)
            azimuth = np.arctan2(*(tool - base)[1::-1]) - _SIDE
            direction = np.array([np.cos(azimuth), np.sin(azimuth), 0.55])
        else:
            direction = np.array(
                {
                    (0, 1): (0.0, -0.45, 1.0),
                    (0, 2): (0.0, -1.0, 0.3),
                    (1, 2): (1.0, 0.0, 0.3),
                }[plane]
            )
        return np.asarray(direction / np.linalg.norm(direction))


def _segments(points: np.ndarray) -> np.ndarray:
    """Straight pieces (K - 1, 2, 3) between points (K, 3)."""
    return np.stack([points[:-1], points[1:]], axis=1)


def speed_colours(parts: np.ndarray) -> np.ndarray:
    """Colours (K, 3) from 0 to 255 of speeds (K,) as parts of the largest one: Matplotlib's plasma but its pale end."""
    from matplotlib import colormaps

    return np.asarray(colormaps["plasma"](0.88 * parts, bytes=True)[:, :3])


def _still(found: Placements, joint: int) -> bool:
    """Whether what this joint moves stays where it is in all postures."""
    frames: Any = np.hstack([found.positions[:, joint], found.quaternions[:, joint]])
    return bool(np.ptp(frames, axis=0).max() < 1e-9)
