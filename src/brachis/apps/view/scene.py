"""The viewer's scene in space: robot, ghost postures, path, tool trace, frames and ground."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.apps.plots.postures import plane_of
from brachis.apps.view.bodies import bodies_of, placements, prescribed_path
from brachis.scene import scene_of
from brachis.scene.chain import Chain
from brachis.scene.scene import Scene
from brachis.trajectory import Trajectory

if TYPE_CHECKING:
    import viser

_PATHS = "/joint 0"
"""Name of the frame of the paths in the scene."""


class ViewerScene:
    """A robot and its motion in the browser.

    Parameters
    ----------
    server : viser.ViserServer
    trajectory : Trajectory

    Attributes
    ----------
    samples : Samples
        Samples of the motion at equidistant times.
    bodies : Bodies
    layers : dict of str to list of handles
        Parts of the scene that can be shown and hidden, by name.
    cell : float
        Size of the cells of the ground's grid, m.
    """

    def __init__(self, server: viser.ViserServer, trajectory: Trajectory) -> None:
        self._api = server.scene
        self._trajectory = trajectory
        self._robot = trajectory.robot
        self.samples = trajectory.at(np.linspace(0.0, trajectory.t_end, 401))
        self.bodies = bodies_of(trajectory)
        self._size = float(np.linalg.norm(np.ptp(self.bodies.moving_box, axis=0)))
        # With a plain light, pale robots are easier to see on the white page.
        self._api.configure_environment_map(None)
        self._api.add_light_hemisphere(
            "/light",
            sky_color=(255, 255, 255),
            ground_color=(120, 120, 130),
            intensity=2.0,
        )
        self.layers: dict[str, list[viser.SceneNodeHandle]] = defaultdict(list)
        self._frames = [
            self._api.add_frame(f"/joint {k}", show_axes=False)
            for k in range(self._robot.n + 1)
        ]
        self._draw_bodies()
        self._draw_ghosts()
        self._draw_path()
        self._draw_trace()
        tool = self._frame("/tool", 0.1)
        self._frames.append(tool)
        self.layers["tool frame"].append(tool)
        self.layers["world frame"].append(self._frame("/world", 0.15))
        self._draw_ground()
        self._parts = [part for part, _, _ in trajectory.split_times(np.zeros(1))]
        self._cells = [scene_of(part.robot, part.task) for part in self._parts]
        if any(cell is not None and len(cell.pairs) for cell in self._cells):
            line = (np.zeros((2, 3)), (200, 30, 30), 3.0)
            self._draw_line("closest pair", f"{_PATHS}/closest/line", *line)
            label = self._api.add_label(f"{_PATHS}/closest/label", "")
            self.layers["closest pair"].append(label)
        hidden = "skeleton" if self.bodies.shows_links else "robot"
        for name in ("world frame", hidden):
            self.set_visible(name, visible=False)
        self._aim(server)

    def set_visible(self, name: str, *, visible: bool) -> None:
        """Show or hide one of the `layers`."""
        for handle in self.layers[name]:
            handle.visible = visible

    def show(self, t: float) -> None:
        """Show the robot at a time, s."""
        q = self._trajectory.position(t)
        positions, quaternions = placements(self._robot, q[None])
        for k, handle in enumerate(self._frames):
            handle.position = positions[0, k]
            handle.wxyz = quaternions[0, k]
        begins = [begin for begin, _ in self._trajectory.components[1:]]
        number = int(np.searchsorted(begins, t, side="right"))
        names = {body.name for body in self._parts[number].task.scene}
        for name, handle in self._passing:
            handle.visible = name in names
        cell = self._cells[number]
        if cell is not None and len(cell.pairs):
            self._show_closest(cell, q)

    def _show_closest(self, cell: Scene, q: np.ndarray) -> None:
        """Draw a line between the closest bodies in a posture, (n,), and write their distance."""
        line, label = self.layers["closest pair"]
        if not line.visible:
            return
        closest = cell.find_closest(Chain.of(self._robot.model).place(q[None]))
        line.points = closest.points
        label.position = closest.points[0].mean(axis=0)
        distance = 1e3 * closest.distance[0]
        label.text = f"{cell.names(closest.pair[0])}: {distance:.1f} mm"

    def _frame(self, name: str, fraction: float) -> viser.FrameHandle:
        """Add the axes of a frame, whose length is a fraction of the scene's size."""
        length = fraction * self._size
        return self._api.add_frame(
            name,
            axes_length=length,
            axes_radius=0.03 * length,
            origin_radius=0.06 * length,
        )

    def _draw_bodies(self) -> None:
        """Attach the links and the skeleton to the frames of the joints, with one asset per joint and layer."""
        import trimesh

        self._passing = []
        for name, bodies in self.bodies.passing.items():
            for joint, meshes in bodies.items():
                asset = trimesh.Scene(meshes).export(file_type="glb")
                handle = self._api.add_glb(f"/joint {joint}/scene/{name}", asset)
                self._passing.append((name, handle))
        layers = {"robot": self.bodies.links, "skeleton": self.bodies.skeleton}
        for layer, bodies in layers.items():
            for joint, meshes in bodies.items():
                asset = trimesh.Scene(meshes).export(file_type="glb")
                handle = self._api.add_glb(f"/joint {joint}/{layer}", asset)
                self.layers[layer].append(handle)

    def _draw_ghosts(self) -> None:
        """Draw faint copies of the moving bodies, darker at later times. Large meshes become their convex hulls."""
        import trimesh

        links = self.bodies.links
        bodies = links if self.bodies.shows_links else self.bodies.skeleton
        times = np.linspace(0.0, self._trajectory.t_end, 6)
        frames = placements(self._robot, self._trajectory.position(times))
        shades = np.linspace([190, 214, 235], [25, 75, 125], 6).astype(np.uint8)
        for joint, meshes in bodies.items():
            positions, quaternions = (components[:, joint] for components in frames)
            placed = np.hstack([positions, quaternions])
            if np.ptp(placed, axis=0).max() < 1e-9:  # the body stands still
                continue
            coarse = [
                mesh.convex_hull if len(mesh.faces) > 2000 else mesh for mesh in meshes
            ]
            bare = [trimesh.Trimesh(mesh.vertices, mesh.faces) for mesh in coarse]
            mesh_of_body = trimesh.util.concatenate(bare)
            handle = self._api.add_batched_meshes_simple(
                f"/ghosts/{joint}",
                mesh_of_body.vertices,
                mesh_of_body.faces,
                batched_positions=positions,
                batched_wxyzs=quaternions,
                batched_colors=shades,
                opacity=0.13,
                cast_shadow=False,
                receive_shadow=False,
            )
            self.layers["ghost postures"].append(handle)

    def _draw_path(self) -> None:
        """Draw the prescribed path and mark its ends."""
        points = prescribed_path(self._trajectory, self.samples)
        self._draw_line("path", f"{_PATHS}/path", points, (30, 30, 30), 2.5)
        for name, k, colour in (("start", 0, (0, 158, 115)), ("end", -1, (213, 94, 0))):
            ball = self._api.add_icosphere(
                f"{_PATHS}/path/{name}",
                0.009 * self._size,
                color=colour,
                position=points[k],
            )
            self.layers["path"].append(ball)

    def _draw_trace(self) -> None:
        """Draw the tool's path in 32 colours by its speed; viser would show the colours of single points too light."""
        speed = self.samples.tool_speed
        fractions = 0.5 * (speed[:-1] + speed[1:]) / max(speed.max(), 1e-9)
        shades = np.round(31.0 * fractions).astype(int)
        colours = speed_colours(np.linspace(0.0, 1.0, 32))
        points = self.samples.tool_position
        for shade in np.unique(shades).tolist():
            name = f"{_PATHS}/trace/{shade}"
            drawn = shades == shade
            self._draw_line("tool trace", name, points, colours[shade], 7.0, drawn)

    def _draw_line(
        self,
        layer: str,
        name: str,
        points: np.ndarray,
        colour: Any,
        thickness: float,
        drawn: np.ndarray | slice = slice(None),
    ) -> None:
        """Draw the chosen straight pieces between points, (K, 3), with a thickness in pixels."""
        pieces = np.stack([points[:-1], points[1:]], axis=1)[drawn]
        line = self._api.add_line_segments(
            name, pieces, colour, thickness=thickness, thickness_units="screen"
        )
        self.layers[layer].append(line)

    def _draw_ground(self) -> None:
        """Draw a grid below all bodies."""
        low, high = self.bodies.box
        self.cell = float(10.0 ** np.round(np.log10(0.06 * self._size)))
        section = 10.0 * self.cell
        width, height = section * np.ceil((high - low)[:2] / section + 1.0)
        centre = section * np.round(0.5 * (low + high)[:2] / section)
        grid = self._api.add_grid(
            "/ground",
            width=float(width),
            height=float(height),
            cell_size=self.cell,
            section_size=section,
            cell_color=(225, 225, 225),
            section_color=(170, 170, 170),
            shadow_opacity=0.2,
            position=(*centre, min(0.0, float(low[2])) - 1e-3 * self._size),
        )
        self.layers["ground"].append(grid)

    def _aim(self, server: viser.ViserServer) -> None:
        """Aim the camera: at the plane of a planar motion, or else from the side to which the arm reaches."""
        camera = server.initial_camera
        camera.fov = 0.75  # rad
        # The camera is at 1.35 times the distance from which the motion fills the height of the picture.
        distance = 1.35 * 0.5 * self._size / np.sin(0.5 * camera.fov)
        camera.near = 0.005 * distance
        camera.far = 100.0 * distance
        camera.look_at = self.bodies.moving_box.mean(axis=0)
        positions, _ = placements(self._robot, self.samples.q)
        first = self._robot.urdf_dynamics.carriers + 1
        reach = (positions[:, -1] - positions[:, first]).mean(axis=0)
        azimuth = np.arctan2(reach[1], reach[0]) - np.radians(50.0)
        directions = {
            None: (np.cos(azimuth), np.sin(azimuth), 0.55),
            (0, 1): (0.0, -0.45, 1.0),
            (0, 2): (0.0, -1.0, 0.3),
            (1, 2): (1.0, 0.0, 0.3),
        }
        direction = np.array(directions[plane_of(self._trajectory)])
        away = direction / np.linalg.norm(direction)
        camera.position = camera.look_at + distance * away


def speed_colours(fractions: np.ndarray) -> np.ndarray:
    """Return colours, (K, 3), 0 to 255, for fractions (K,) of the largest speed: plasma without its pale end."""
    from matplotlib import colormaps

    return colormaps["plasma"](0.88 * fractions, bytes=True)[:, :3]
