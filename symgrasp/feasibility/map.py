"""Feasibility maps: where on an object an arm can hold it for a task, and why not elsewhere."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from symgrasp import page
from symgrasp.errors import SymgraspError
from symgrasp.feasibility import pictures
from symgrasp.feasibility.cell import Cell, Margin, Window, Witness, rests_on_samples
from symgrasp.feasibility.color_by import ColorBy, color_map
from symgrasp.feasibility.map_files import ARRAYS, FORMAT_VERSION, read_map
from symgrasp.feasibility.margins import cells_to_infeasible
from symgrasp.feasibility.refined import Refined
from symgrasp.files import write_atomically
from symgrasp.object.manifold import ROLLS, Manifold
from symgrasp.poses import Array, rotation_z
from symgrasp.reason import Reason

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from xarray import Dataset

    from symgrasp.scene.scene import Scene

__all__ = ["FeasibilityMap"]


@dataclass(frozen=True, eq=False)
class FeasibilityMap:
    """The map m(x, T) of one arm and one task, by roll, height and angle.

    All arrays are read-only. R = 2 rolls, H heights, A angles, n joints.

    Attributes:
        scene: name of the scene.
        arm: name of the arm.
        task: name of the task.
        T_world_object: object pose (4, 4).
        manifold: the grid.
        reason: (R, H, A) uint8 of `Reason`.
        q: (R, H, A, n) joint values of the witnesses, NaN where infeasible.
        sample: (R, H, A) int32 redundancy sample of the witness, -1 where infeasible.
        branch: (R, H, A) int16 branch of the witness, -1 where infeasible.
        clearance: (R, H, A) distance (m) that all bodies which must not touch have at the witness at
            least, at most `CLEARANCE_LIMIT`; NaN where infeasible. At no other sample and branch is it
            larger by more than 2 mm. The reference, which only asks whether bodies touch, has 0.
        phi: (K,) redundancy samples (rad).
        opening: (H,) opening of the hand (m).
        bodies: names of bodies.
        pair: (R, H, A, 2) int16 into ``bodies``: what hits what, for a cell whose reason is a
            collision, of the candidate that came closest to being free; -1 elsewhere.
        depth: (R, H, A) how much closer (m) than allowed that pair is, NaN elsewhere.
        proven: (R, H, A) bool, whether it is proven that no redundancy value makes the cell feasible: the
            hand does not fit or collides, or the pose is further away than the arm reaches. What else is
            infeasible is so at all values that were tried, see `rests_on`.
        resolution: width (rad) of the parts of the redundancy's range below which nothing is told apart,
            where all of it was searched; 0 where samples were.
        shown_in: the scene, for `show`; it is not saved, so a map from a file has None.
        ease: (R, H, A) how easily the arm stands at each witness, see `symgrasp.robot.posture.ease`, where
            planners have asked for it; it is not saved.
        pitches: pitches (rad) that the hand is held at: then the first axis has all rolls at the first pitch,
            all rolls at the second, and so on, and a cell's roll is an index into them. Empty where the pitch
            is free, or there is none. It is not saved: only planners have such maps.
        certified: (R, H, A) bool, whether it is proven that a cell holds as a whole: a feasible one is so at
            every height and angle inside it, an infeasible one at none; the others may be mixed. None where
            that was not asked for.
        refined: the cells that may be mixed, split down to the resolution that the scene asks for, or as they
            are where it asks for none; None where no feasible cell can be certified.
        preliminary: whether cells have the reasons of coarser ones, of which few configurations were tried;
            then there are no witnesses.
        probability: (R, H, A) how probable it is that a cell is feasible where the object's pose is
            uncertain, see `symgrasp.survey.success`; None where that was not asked for. It is not saved.
        widest: (R, H, A) width (rad) of the widest of each cell's `windows`, NaN where infeasible; None where
            that was not asked for. It is not saved.
        find_windows: finds the windows of a cell; None where the map does not know its scene.
    """

    scene: str
    arm: str
    task: str
    T_world_object: Array
    manifold: Manifold
    reason: np.ndarray
    q: Array
    sample: np.ndarray
    branch: np.ndarray
    clearance: Array
    phi: Array
    opening: Array
    bodies: tuple[str, ...]
    pair: np.ndarray
    depth: Array
    proven: np.ndarray
    resolution: float = 0.0
    shown_in: Scene | None = None
    ease: Array | None = None
    pitches: tuple[float, ...] = ()
    certified: np.ndarray | None = None
    refined: Refined | None = None
    preliminary: bool = False
    probability: Array | None = None
    widest: Array | None = None
    find_windows: Callable[[FeasibilityMap, Cell], tuple[Window, ...]] | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Return a copy of the attributes to pickle: another thread may cache one meanwhile."""
        return self.__dict__.copy()

    def __post_init__(self) -> None:
        for name in ARRAYS:
            array = np.array(getattr(self, name))
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if self.certified is not None:
            self.certified.setflags(write=False)

    @cached_property
    def feasible(self) -> np.ndarray:
        """(R, H, A) bool."""
        return self.reason == Reason.FEASIBLE

    def roll_and_pitch(self, roll: int) -> tuple[int, float]:
        """Return the index into `ROLLS` and the pitch (rad) that a cell's roll stands for."""
        pitch, own = divmod(roll, len(ROLLS))
        return own, self.pitches[pitch] if self.pitches else 0.0

    def witness(self, cell: Cell | tuple[int, int, int]) -> Witness | None:
        """Return the configuration that proves a cell feasible; None elsewhere, and on a preliminary map."""
        cell = Cell(*cell)
        if self.preliminary or not self.feasible[cell]:
            return None
        sample = int(self.sample[cell])
        return Witness(
            self.q[cell],
            float(self.phi[sample]),
            sample,
            int(self.branch[cell]),
            float(self.opening[cell.row]),
            float(self.clearance[cell]),
        )

    def why(self, cell: Cell | tuple[int, int, int]) -> str:
        """Say in one line whether a cell is feasible, and if not, why."""
        cell = Cell(*cell)
        text = Reason(int(self.reason[cell])).legend
        first, second = self.pair[cell]
        if first < 0:
            return text
        depth = 1e3 * self.depth[cell]
        return f"{text}: {self.bodies[first]} and {self.bodies[second]}, {depth:.1f} mm too close"

    def rests_on(self, cell: Cell | tuple[int, int, int]) -> str:
        """Say in words what it rests on that a cell is feasible or infeasible."""
        cell = Cell(*cell)
        if self.preliminary:
            return "a coarse map"
        if self.feasible[cell]:
            return "its witness"
        if self.proven[cell]:
            return "a proof"
        if self.resolution:
            return f"a search of the redundancy to {self.resolution:.0e} rad"
        return rests_on_samples(len(self.phi))

    def holds(self, cell: Cell | tuple[int, int, int]) -> str:
        """Say in words whether a cell is proven to hold as a whole; empty where that was not asked for."""
        if self.certified is None:
            return ""
        return "proven for the whole cell" if self.certified[Cell(*cell)] else "not proven for the whole cell"

    @property
    def certified_share(self) -> float | None:
        """Share of the cells that are proven to hold as a whole; None where that was not asked for."""
        return None if self.certified is None else float(self.certified.mean())

    def counts(self) -> dict[Reason, int]:
        """Return how many cells each reason has, most frequent first."""
        values, counts = np.unique(self.reason, return_counts=True)
        order = np.argsort(-counts, kind="stable")
        return {Reason(int(values[k])): int(counts[k]) for k in order}

    @property
    def margins_proven(self) -> bool:
        """Whether `margins` are proven lower bounds; else they are counted in cells."""
        return self.refined is not None

    @cached_property
    def margins(self) -> Array:
        """(R, H, A, 2) how far from cells' centres grasps stay feasible, along (m) and around (rad) the axis.

        Proven lower bounds where cells are certified (`margins_proven`): no grasp that is off by less, along
        or around, is infeasible. Else `cell_margins`.
        """
        if self.refined is None:
            return self.cell_margins
        margins = np.where(self.feasible[..., None], self.refined.margins(self.manifold), 0.0)
        margins.setflags(write=False)
        return margins

    @cached_property
    def cell_margins(self) -> Array:
        """(R, H, A, 2) distance along the axis (m) and angle around it (rad) to the nearest infeasible cell.

        Zero where infeasible. Both ends of the object count as infeasible; around the object
        half a turn is the most there is.
        """
        along, around = cells_to_infeasible(self.feasible)
        margins = np.empty((*self.feasible.shape, 2))
        margins[..., 0], margins[..., 1] = along * self.manifold.dh, around * self.manifold.dtheta
        margins.setflags(write=False)
        return margins

    def margin(self, cell: Cell | tuple[int, int, int]) -> Margin:
        """Return how far a grasp may be off a cell's centre along and around the object, see `margins`."""
        return Margin(*self.margins[Cell(*cell)].tolist())

    def windows(self, cell: Cell | tuple[int, int, int]) -> tuple[Window, ...]:
        """Find all intervals of the redundancy φ on which the arm holds a cell's grasp, branch by branch.

        Along a window the elbow may move while the hand stays. The range of φ is halved until each branch is
        excluded on a part or free all along it: at values of φ 0.001 rad apart at most (0.005 with a retreat
        or where the robot could fall), and by what is usual for how arms move in between, which is a bound
        that was measured, not proven; see `Window.whole`. Windows end to 1e-4 rad; narrower ones, and
        narrower gaps, may be missed. Where the range is a full turn, one over its end is in two.

        Args:
            cell: the cell, at its centre.

        Returns:
            The windows, by branch, then by φ: one holds the witness, and there is none where nothing is free.
            Those of an arm on a torso are at the value of the torso at which the witness is.

        Raises:
            InputError: the arm has six joints or fewer, of which a grasp leaves none free.
            SymgraspError: the map does not know its scene: it was loaded from a file, say.
        """
        if self.find_windows is None:
            raise SymgraspError("windows need the scene of the map, which maps of `create_map` know")
        return self.find_windows(self, Cell(*cell))

    def shift(self, delta: float) -> FeasibilityMap:
        """Return the map for the object turned by ``delta`` (rad) about its axis, without recomputing it.

        Equation 3: ``m((h, θ), T·Rz(δ)) = m((h, θ + δ), T)``. Exact for every angle: whole cells
        roll the map, the rest moves the start of the grid.
        """
        manifold, k = self.manifold.shift(delta)
        rolled = {
            name: np.roll(getattr(self, name), -k, axis=2)
            for name in ("reason", "q", "sample", "branch", "clearance", "pair", "depth", "proven")
        }
        for name in ("ease", "certified", "probability", "widest"):
            if (cells := getattr(self, name)) is not None:
                rolled[name] = np.roll(cells, -k, axis=2)
        if self.refined is not None:
            rolled["refined"] = self.refined.shift(manifold, k)
        turned = self.T_world_object @ rotation_z(delta)
        return replace(self, T_world_object=turned, manifold=manifold, **rolled)

    def masked(self, keep: np.ndarray) -> FeasibilityMap:
        """Return the map with every feasible cell outside ``keep`` (R, H, A) taken for out of reach."""
        drop = self.feasible & ~keep
        return replace(
            self,
            reason=np.where(drop, Reason.UNREACHABLE, self.reason).astype(np.uint8),
            q=np.where(drop[..., None], np.nan, self.q),
            sample=np.where(drop, -1, self.sample),
            branch=np.where(drop, -1, self.branch),
            clearance=np.where(drop, np.nan, self.clearance),
            proven=self.proven & ~drop,
            certified=None if self.certified is None else self.certified & ~drop,
            refined=self.refined and self.refined.masked(~drop),
            probability=None,
            widest=None,
        )

    def values(self, color_by: ColorBy) -> Array:
        """Return the values (R, H, A) that colours stand for, in their unit; NaN where there is none."""
        if color_by is ColorBy.CLEARANCE:
            return 1e3 * self.clearance
        if color_by is ColorBy.PROBABILITY:  # also of cells that are infeasible where the object should be
            return np.full(self.reason.shape, np.nan) if self.probability is None else 100 * self.probability
        if color_by is ColorBy.WINDOW:
            return np.full(self.reason.shape, np.nan) if self.widest is None else np.rad2deg(self.widest)
        if color_by is ColorBy.ALONG:
            found = 1e3 * self.margins[..., 0]
        elif color_by is ColorBy.AROUND:
            found = np.rad2deg(self.margins[..., 1])
        elif color_by is ColorBy.OPENING:
            found = 1e3 * self.opening[:, None]
        else:
            found = np.nan
        return np.where(self.feasible, found, np.nan)

    def plot(self, color_by: ColorBy = ColorBy.REASON, marks: Sequence[tuple[float, float]] = ()) -> Figure:
        """Draw both rolls of the map with axes, a legend and counts, or the scale of the values.

        Where the scene asks for a resolution, reasons are those of the parts that cells are split into, and
        counts are of parts. What is not proven to hold as a whole is lighter, if that was asked for.

        Args:
            color_by: what the colours stand for.
            marks: grasps (h, θ) (m, rad) to circle.
        """
        m = self.manifold
        title = f"{self.scene} · {self.task} · {self.arm}"
        if self.preliminary:
            title += " · coarse, preliminary"
        parts = self.refined if self.refined and color_by.has_parts else self
        coloured = color_map(color_by, parts.reason, self.values(color_by), parts.certified)
        heights = (m.profile.h_min, m.profile.h_max)
        return pictures.draw_map(coloured, heights, m.theta_start, title, ("roll 0°", "roll 180°"), marks)

    def _repr_png_(self) -> bytes:
        """Return the picture that a notebook displays for a map."""
        return pictures.to_png(self.plot())

    def show(self) -> None:
        """Show the picture of the map, and the object and the arm in 3D.

        A notebook displays both, and while its kernel runs on the machine of the browser the live page in
        place of the 3D view: the scene with the map of this task and arm, to be played with. Elsewhere they
        are written to files in the system's temporary folder, whose addresses are printed, and the 3D view
        is opened in a browser. A map that was loaded from a file does not know its scene, so its picture is
        all there is.
        """
        name = f"{self.scene}, {self.task} with {self.arm}"
        page.show_picture(self._repr_png_(), name)
        if self.shown_in is None:
            print(f"{name}: no 3D view, because the map does not know its scene")
            return
        try:
            notebook = page.page_module("server.notebook")
            document = notebook.map_document(self, self.shown_in)
        except (ImportError, SymgraspError) as error:
            print(f"{name}: no 3D view: {error}")
            return
        live = None
        if page.in_notebook():
            try:
                live = notebook.map_page(self, self.shown_in)
            except (OSError, SymgraspError) as error:
                print(f"{name}: no live page: {error}")
        page.show_html(document, name, live)

    def _meta(self) -> dict[str, Any]:
        return {
            "format": "symgrasp feasibility map",
            "version": FORMAT_VERSION,
            "units": "m, rad",
            "scene": self.scene,
            "arm": self.arm,
            "task": self.task,
            "heights": self.manifold.heights,
            "angles": self.manifold.angles,
            "theta_start": self.manifold.theta_start,
            "bodies": list(self.bodies),
            "reasons": [r.name for r in Reason],
            "resolution": self.resolution,
            "preliminary": self.preliminary,
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the map as plain data for JSON.

        The grid, and by roll, height and angle: the reason, and in m and rad the clearance (null where
        infeasible) and the margins.
        """
        return {
            **self._meta(),
            "T_world_object": self.T_world_object.tolist(),
            "profile": self.manifold.profile.points.tolist(),
            "rolls": list(ROLLS),
            "h": self.manifold.h.tolist(),
            "theta": self.manifold.theta.tolist(),
            "opening": self.opening.tolist(),
            "reason": self.reason.tolist(),
            "clearance": _listed(self.clearance),
            "margin_along": self.margins[..., 0].tolist(),
            "margin_around": self.margins[..., 1].tolist(),
            "proven": self.proven.tolist(),
            "certified": None if self.certified is None else self.certified.tolist(),
            "refined": self.refined and self.refined.to_dict(),
        }

    def to_xarray(self) -> Dataset:
        """Return the map with named dimensions, as a `xarray.Dataset`; needs ``symgrasp[survey]``.

        Dimensions are roll, h, theta (rad, m, rad: centres of the cells) and joint. Variables are what the
        attributes of the map are called; ``margin`` has along (m) and around (rad) apart.

        Raises:
            SymgraspError: xarray is not installed.
        """
        try:
            import xarray as xr
        except ImportError as error:
            raise SymgraspError("this needs xarray: pip install 'symgrasp[survey]'") from error
        cells, m = ("roll", "h", "theta"), self.manifold
        rolls = np.arange(len(self.reason)) if self.pitches else np.array(ROLLS)
        data = {
            "reason": (cells, self.reason, {"flag_values": [int(r) for r in Reason],
                                            "flag_meanings": " ".join(r.name for r in Reason)}),
            "feasible": (cells, self.feasible),
            "proven": (cells, self.proven),
            "clearance": (cells, self.clearance, {"units": "m"}),
            "margin_along": (cells, self.margins[..., 0], {"units": "m"}),
            "margin_around": (cells, self.margins[..., 1], {"units": "rad"}),
            "q": ((*cells, "joint"), self.q, {"units": "rad or m", "long_name": "joints of the witness"}),
            "opening": ("h", self.opening, {"units": "m", "long_name": "opening of the hand"}),
            "radius": ("h", m.profile.radius(m.h), {"units": "m", "long_name": "radius of the object"}),
        }  # fmt: skip
        coordinates = {
            "roll": ("roll", rolls, {} if self.pitches else {"units": "rad"}),
            "h": ("h", m.h, {"units": "m", "long_name": "height along the object's axis"}),
            "theta": ("theta", m.theta, {"units": "rad", "long_name": "angle around the object's axis"}),
        }
        if self.certified is not None:
            data["certified"] = (cells, self.certified)
        about = {
            "scene": self.scene,
            "arm": self.arm,
            "task": self.task,
            "preliminary": int(self.preliminary),
        }
        pose = {"T_world_object": self.T_world_object.ravel().tolist()}
        return xr.Dataset(data, coordinates, {**about, **pose})

    def to_npz(self) -> bytes:
        """Return the map as the content of an npz file."""
        buffer = io.BytesIO()
        arrays = {name: getattr(self, name) for name in ARRAYS}
        if self.certified is not None:
            arrays["certified"] = self.certified
        if self.refined is not None:
            arrays["refined_reason"] = self.refined.reason
            arrays["refined_certified"] = self.refined.certified
        meta = np.array(json.dumps(self._meta()))
        np.savez_compressed(buffer, meta=meta, profile=self.manifold.profile.points, **arrays)
        return buffer.getvalue()

    def save(self, path: str | Path) -> None:
        """Write the map as npz, in one piece."""
        with write_atomically(Path(path)) as file:
            file.write(self.to_npz())

    @staticmethod
    def load(path: str | Path) -> FeasibilityMap:
        """Read a map written by `save`.

        Raises:
            MapError: the file is missing or is not such a map.
        """
        return FeasibilityMap(**read_map(path))


def _listed(values: Array) -> list[Any]:
    """Return an array as lists with None for NaN, which JSON does not have."""
    listed = values.astype(object)
    listed[np.isnan(values)] = None
    return listed.tolist()
