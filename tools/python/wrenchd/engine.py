# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine: penetration depth of meshes, as the daemon computes it. No daemon is needed.

    import numpy as np, wrenchd
    peg, hole = wrenchd.Mesh.load("peg.stl", scale=1e-3), wrenchd.Mesh(vertices, faces)
    scene = wrenchd.Scene(tool=wrenchd.Body(peg, mass=0.2), obstacles=[hole])
    answer = scene.project([0, 0, 0.01, 0, 0, 0, 1])
    print(answer.energy, answer.eps, answer.contacts)

Conventions. Lengths are metres, masses kilograms, angles radians, times seconds. A pose is that of the mesh frame M in the
world W: seven numbers (x, y, z [m], then the unit quaternion x, y, z, w) or a 4x4 matrix. A table of poses has shape (N, 7)
or (N, 4, 4). Six-vectors hold the linear part first. The body frame T has the axes of M and its origin at the centre of
mass of the tool.
"""

import itertools
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Iterator, List, Optional, Sequence, Tuple, Union

import numpy as np

from . import _engine
from ._engine import MeshError

Vector = Union[Sequence[float], np.ndarray]
IDENTITY = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
_ids = itertools.count(1)


def _vector(values: Any, what: str) -> np.ndarray:
    out = np.asarray(values, dtype=np.float64)
    if out.shape != (3,) or not np.all(np.isfinite(out)):
        raise ValueError(f"{what}: expected three finite numbers, not {values!r}")
    return out


def _number(value: float, what: str, low: float, high: float = np.inf) -> float:
    out = float(value)
    if not low <= out <= high:  # also NaN
        raise ValueError(f"{what}: expected a number from {low:g} to {high:g}, not {value!r}")
    return out


def poses(values: Any) -> np.ndarray:
    """Returns poses as an array of shape (N, 7).

    values: shape (7,), (4, 4), (N, 7) or (N, 4, 4). Raises ValueError for other shapes, numbers that are not finite,
    quaternions without unit norm and matrices that are no rotations, with the number of the first such pose.
    """
    array = np.asarray(values, dtype=np.float64)
    if array.shape == (7,) or array.shape == (4, 4):
        array = array[np.newaxis]
    if array.ndim == 3 and array.shape[1:] == (4, 4):
        array = _from_matrices(array)
    if array.ndim != 2 or array.shape[1] != 7:
        raise ValueError(f"poses: expected the shape (7,), (4, 4), (N, 7) or (N, 4, 4), not {np.shape(values)}")
    _reject_first(~np.isfinite(array).all(axis=1), "has numbers that are not finite")
    norm = np.linalg.norm(array[:, 3:], axis=1)
    _reject_first(np.abs(norm - 1.0) > 1e-6, "has a quaternion (x, y, z, w) that is not of unit length")
    return array


def _reject_first(bad: np.ndarray, why: str) -> None:
    if bad.any():
        raise ValueError(f"poses: pose {int(np.argmax(bad))} {why}")


def _from_matrices(matrices: np.ndarray) -> np.ndarray:
    """The quaternion whose largest component is found first, so that no division is by a small number."""
    R = matrices[:, :3, :3]
    _reject_first(~np.isfinite(matrices).all(axis=(1, 2)), "has numbers that are not finite")
    error = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    _reject_first((error > 1e-6) | (np.linalg.det(R) < 0.0), "is a matrix whose upper left 3x3 block is no rotation")
    _reject_first(np.abs(matrices[:, 3] - [0.0, 0.0, 0.0, 1.0]).max(axis=1) > 0.0,
                  "is a matrix whose last row is not 0, 0, 0, 1")
    xx, yy, zz = R[:, 0, 0], R[:, 1, 1], R[:, 2, 2]
    squares = np.stack([1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz, 1 + xx + yy + zz], axis=1)
    xy, xz, yz = R[:, 0, 1] + R[:, 1, 0], R[:, 0, 2] + R[:, 2, 0], R[:, 1, 2] + R[:, 2, 1]
    wx, wy, wz = R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]
    columns = np.stack([
        np.stack([squares[:, 0], xy, xz, wx], axis=1), np.stack([xy, squares[:, 1], yz, wy], axis=1),
        np.stack([xz, yz, squares[:, 2], wz], axis=1), np.stack([wx, wy, wz, squares[:, 3]], axis=1)], axis=1)
    q = columns[np.arange(len(R)), squares.argmax(axis=1)]
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    return np.concatenate([matrices[:, :3, 3], q], axis=1)


@dataclass(frozen=True)
class MeshReport:
    """What a mesh is, what was repaired, and what prevents its use."""

    vertices: int
    faces: int
    closed: bool  #: every edge belongs to exactly two faces
    consistent: bool  #: adjacent faces traverse their common edge in opposite directions
    outward: bool  #: the faces bound a volume and face outwards
    self_intersecting: bool
    volume: float  #: [m^3]; NaN unless the mesh is closed and consistent
    tolerated: str  #: why a solid is accepted although its faces intersect; empty: they do not
    repairs: Tuple[str, ...]  #: one sentence for each kind of repair
    defects: Tuple[str, ...]  #: one sentence each: what, where, how many, and the remedy
    text: str  #: the message of the error that a scene with this mesh raises; empty: none

    @property
    def usable(self) -> bool:
        return not self.defects


class Mesh:
    """Vertices and faces, as a file or a program gives them. Neither repaired nor checked: a scene does both.

    vertices: (n, 3) [mesh units]. faces: (m, k) vertex numbers from 0, or a list of such lists of any lengths, each
    counter-clockwise seen from outside. scale: metres per mesh unit. name: used in messages.
    Immutable, and can be pickled.
    """

    def __init__(self, vertices: Any, faces: Any, scale: float = 1.0, name: str = "mesh") -> None:
        points = np.array(vertices, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3:
            raise ValueError(f"{name}: vertices: expected the shape (n, 3), not {points.shape}")
        if isinstance(faces, np.ndarray) and faces.ndim == 2:
            sizes = np.full(len(faces), faces.shape[1], dtype=np.int64)
            corners = np.array(faces)
        else:
            lists = [np.asarray(face) for face in faces]
            if any(face.ndim != 1 for face in lists):
                raise ValueError(f"{name}: faces: expected the shape (m, k), or a list of lists of vertex numbers")
            sizes = np.array([len(face) for face in lists], dtype=np.int64)
            corners = np.concatenate(lists) if lists else np.zeros(0, dtype=np.int64)
        if corners.size and not np.issubdtype(corners.dtype, np.integer):
            raise ValueError(f"{name}: faces: expected whole numbers, not {corners.dtype}")
        self._set(points, corners.astype(np.int64).ravel(), sizes, scale, name)

    def _set(self, vertices: np.ndarray, corners: np.ndarray, sizes: np.ndarray, scale: float, name: str) -> None:
        self._vertices, self._corners, self._sizes = vertices, corners, sizes
        for array in (vertices, corners, sizes):
            array.setflags(write=False)
        self._scale, self._name = _number(scale, f"{name}: scale", 1e-9, 1e6), str(name)
        self._id = next(_ids)

    @classmethod
    def _of(cls, arrays: Any, scale: float, name: str) -> "Mesh":
        mesh = cls.__new__(cls)
        vertices, corners, sizes = arrays
        mesh._set(vertices, corners, sizes, scale, name)
        return mesh

    @classmethod
    def load(cls, file: Union[str, Path], scale: float = 1.0) -> "Mesh":
        """Reads an OFF, OBJ, STL or PLY file. Raises MeshError that names the file, the line and the cure."""
        return cls._of(_engine.read_mesh(str(file)), scale, str(file))

    @property
    def vertices(self) -> np.ndarray:
        """(n, 3) [mesh units], read-only."""
        return self._vertices

    @property
    def faces(self) -> Union[np.ndarray, List[np.ndarray]]:
        """(m, k) vertex numbers if all faces have k corners, otherwise a list of arrays; read-only."""
        if len(self._sizes) and (self._sizes == self._sizes[0]).all():
            return self._corners.reshape(len(self._sizes), -1)
        return np.split(self._corners, np.cumsum(self._sizes)[:-1]) if len(self._sizes) else []

    @property
    def scale(self) -> float:
        """Metres per mesh unit."""
        return self._scale

    @property
    def name(self) -> str:
        return self._name

    def report(self, kind: str = "solid") -> MeshReport:
        """Repairs a copy and checks it. kind: "solid" or "surface" (may be open, and may intersect itself)."""
        found, _ = self._check(kind)
        found["volume"] *= self._scale**3
        return MeshReport(**{k: tuple(v) if isinstance(v, list) else v for k, v in found.items()})

    def repaired(self, kind: str = "solid") -> "Mesh":
        """Returns the mesh as a scene uses it: repaired and triangulated. Raises MeshError if that is not possible."""
        found, arrays = self._check(kind)
        if arrays is None:
            raise MeshError(found["text"])
        return Mesh._of(arrays, self._scale, self._name)

    def _check(self, kind: str) -> Any:
        return _engine.check_mesh(self._vertices, self._corners, self._sizes, kind, self._name)

    def _passed(self) -> dict:
        return {"name": self._name, "id": self._id, "vertices": self._vertices, "corners": self._corners,
                "sizes": self._sizes}

    def __reduce__(self) -> Any:
        return Mesh._of, ((np.array(self._vertices), np.array(self._corners), np.array(self._sizes)), self._scale,
                          self._name)

    def __repr__(self) -> str:
        return f"<Mesh {self._name}: {len(self._vertices)} vertices, {len(self._sizes)} faces, scale {self._scale:g}>"


@dataclass(frozen=True, eq=False)
class Body:
    """A tool or an obstacle: one mesh, or a list of meshes that form one body.

    For both: kind, "solid" (closed) or "surface" (two sides and no inside).
    For a tool: mass [kg], and inertia, what gives centre of mass and inertia: "solid", "hull" (convex hull), "shell" (with
    shell_thickness [m]), or "given" with centre_of_mass (3,) [m] in M and inertia_tensor (3, 3) [kg m^2] about it. Without a
    value it is "solid" for a solid and "hull" for a surface.
    For an obstacle: name; pose at scene time 0; linear_velocity (3,) [m/s] of its origin and angular_velocity (3,) [rad/s]
    about its origin, both in W.
    """

    mesh: Union[Mesh, Sequence[Mesh]]
    mass: float = 1.0
    kind: str = "solid"
    name: str = ""
    inertia: Optional[str] = None
    shell_thickness: float = 0.0
    centre_of_mass: Vector = (0.0, 0.0, 0.0)
    inertia_tensor: Any = field(default_factory=lambda: np.eye(3))
    pose: Any = IDENTITY
    linear_velocity: Vector = (0.0, 0.0, 0.0)
    angular_velocity: Vector = (0.0, 0.0, 0.0)

    @property
    def meshes(self) -> Tuple[Mesh, ...]:
        return (self.mesh,) if isinstance(self.mesh, Mesh) else tuple(self.mesh)

    def _passed(self, role: str, number: int) -> dict:
        meshes = self.meshes
        if not meshes or not all(isinstance(mesh, Mesh) for mesh in meshes):
            raise TypeError(f"{role} {self.name}: mesh: expected a Mesh or a list of them, not {self.mesh!r}")
        who = self.name or meshes[0].name
        scales = {mesh.scale for mesh in meshes}
        if len(scales) > 1:
            raise ValueError(f"{role} {who}: the meshes of one body need one scale, not {sorted(scales)}")
        inertia = self.inertia or ("hull" if self.kind == "surface" else "solid")
        if self.kind == "surface" and inertia == "solid":
            raise ValueError(f"{role} {who}: a surface bounds no solid; inertia: \"hull\", \"shell\" or \"given\"")
        if inertia == "shell":
            _number(self.shell_thickness, f"{role} {who}: shell_thickness [m]", 1e-9)
        tensor = np.asarray(self.inertia_tensor, dtype=np.float64)
        if tensor.shape != (3, 3) or not np.allclose(tensor, tensor.T) or np.linalg.eigvalsh(tensor)[0] <= 0.0:
            raise ValueError(f"{role} {who}: inertia_tensor: expected a symmetric, positive definite 3x3 matrix")
        moments = np.linalg.eigvalsh(tensor)
        if moments[2] > (1.0 + 1e-6) * (moments[0] + moments[1]):
            raise ValueError(f"{role} {who}: inertia_tensor: no body has it; its largest principal moment "
                             f"{moments[2]:g} exceeds the sum of the other two")
        pose = poses(self.pose)
        if len(pose) != 1:
            raise ValueError(f"{role} {who}: pose: expected one pose, not {len(pose)}")
        return {
            "meshes": [mesh._passed() for mesh in meshes], "scale": meshes[0].scale,
            "mass": _number(self.mass, f"{role} {who}: mass [kg]", 1e-9, 1e9), "kind": self.kind,
            "name": self.name or f"{role} {number}", "inertia": inertia, "shell_thickness": self.shell_thickness,
            "centre_of_mass": _vector(self.centre_of_mass, f"{role} {who}: centre_of_mass [m]"),
            "inertia_tensor": tensor, "pose": pose[0],
            "linear_velocity": _vector(self.linear_velocity, f"{role} {who}: linear_velocity [m/s]"),
            "angular_velocity": _vector(self.angular_velocity, f"{role} {who}: angular_velocity [rad/s]")}


@dataclass(frozen=True)
class HalfSpace:
    """The solid half-space normal . x < offset. normal: (3,) in W, points out of the solid; offset [m]."""

    normal: Vector = (0.0, 0.0, 1.0)
    offset: float = 0.0
    name: str = "plane"

    def _passed(self) -> dict:
        normal = _vector(self.normal, f"half-space {self.name}: normal")
        if np.linalg.norm(normal) < 1e-9:
            raise ValueError(f"half-space {self.name}: normal: expected a vector that is not zero")
        offset = _number(self.offset, f"half-space {self.name}: offset [m]", -np.inf)
        return {"normal": normal, "offset": offset, "name": self.name}


@dataclass(frozen=True)
class Contact:
    """A contact that touches at the projected pose."""

    point: np.ndarray  #: (3,) in W [m]
    normal: np.ndarray  #: (3,) unit normal from the obstacle to the tool, in W
    multiplier: float  #: d energy / d gap [kg m]
    load_fraction: float  #: multiplier as a fraction of the sum over all contacts
    obstacle: str
    tool_feature: str  #: for example "vertex 12", "edge 3-7" or "face 5", numbered as in the mesh
    obstacle_feature: str


@dataclass(frozen=True)
class Projection:
    """The closest admissible pose of one commanded pose, and the wrench."""

    pose: np.ndarray  #: (7,) of the mesh frame at the closest admissible pose q
    energy: float  #: T(p, q) of Eq. (8) [kg m^2]; NaN if none was found
    eps: np.ndarray  #: (6,) Eq. (15) in T: [m], [rad]
    wrench: np.ndarray  #: (6,) of the chosen law in T, about the centre of mass: [N], [N m]
    spatial_wrench: np.ndarray  #: (6,) the same about the world origin, in world axes
    gradient: np.ndarray  #: (6,) d energy / d pose, for p exp([v; w]) in T: [kg m], [kg m^2]
    status: str  #: "free", "converged", "iteration_limit" or "infeasible"
    contact_count: int  #: feature pairs that touch at q
    contacts: List[Contact]  #: at most 16, the largest multiplier first
    kkt_residual: float  #: the part of the pull towards p that no contact balances
    iterations: int
    proven_global: bool  #: no admissible pose is closer
    solve_ns: float

    @property
    def is_free(self) -> bool:
        return self.status == "free"


class Projections:
    """Projections of N poses as arrays: pose (N, 7), energy (N,), eps, wrench, spatial_wrench, gradient (N, 6), status (list),
    contact_count, kkt_residual, iterations, proven_global, solve_ns (N,). Units and frames: Projection. answer[i] is the
    Projection of pose i."""

    pose: np.ndarray
    energy: np.ndarray
    eps: np.ndarray
    wrench: np.ndarray
    spatial_wrench: np.ndarray
    gradient: np.ndarray
    status: List[str]
    contact_count: np.ndarray
    kkt_residual: np.ndarray
    iterations: np.ndarray
    proven_global: np.ndarray
    solve_ns: np.ndarray

    def __init__(self, columns: dict) -> None:
        self._contacts = columns.pop("contacts")
        self.__dict__.update(columns)

    def contacts(self, i: int) -> List[Contact]:
        return [Contact(*one) for one in self._contacts[i]]

    def __getstate__(self) -> dict:
        return {**self.__dict__, "_contacts": [self._contacts[i] for i in range(len(self))]}

    def __len__(self) -> int:
        return len(self.energy)

    def __getitem__(self, i: int) -> Projection:
        return Projection(
            pose=self.pose[i], energy=float(self.energy[i]), eps=self.eps[i], wrench=self.wrench[i],
            spatial_wrench=self.spatial_wrench[i], gradient=self.gradient[i], status=self.status[i],
            contact_count=int(self.contact_count[i]), contacts=self.contacts(i),
            kkt_residual=float(self.kkt_residual[i]), iterations=int(self.iterations[i]),
            proven_global=bool(self.proven_global[i]), solve_ns=float(self.solve_ns[i]))

    def __iter__(self) -> Iterator[Projection]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        return f"<Projections of {len(self)} poses>"


class Scene:
    """A tool and its obstacles. Raises MeshError or ValueError, which name the body, the defect and the cure.

    tool: Body or Mesh. obstacles: any of Body, Mesh and HalfSpace. surface_tolerance [m]: contacts may use a surface that
    encloses a solid and lies at most this far outside of it; 0: the mesh as loaded. smoothing [m]: contacts use curved surfaces
    through the vertices of the meshes, at most this far from their faces; 0: the faces. cache: directory for the results of large
    meshes. method: "exact", "planar" (with planes), "descent" or "translational". friction: static and dynamic coefficient for
    follow(). contacts: "native" or "cgal". law: "pid" (Eq. (16) with K_P = k_p I), or "energy" (the gradient of (k/2) T with
    k = energy_stiffness [1/s^2]).

    Threads may share a scene; their calls then wait for each other. Two scenes run on two cores, because the interpreter's lock
    is released. A scene can be pickled; it is then built anew.
    """

    def __init__(self, tool: Union[Body, Mesh], obstacles: Sequence[Union[Body, Mesh, HalfSpace]] = (), *,
                 surface_tolerance: float = 1e-6, smoothing: float = 0.0, cache: Union[str, Path, None] = None, method: str = "exact",
                 planes: int = 47, friction: Tuple[float, float] = (0.0, 0.0), contacts: str = "native",
                 law: str = "pid", k_p: float = 1.0, energy_stiffness: float = 1.0) -> None:
        self._tool = Body(tool) if isinstance(tool, Mesh) else tool
        self._obstacles = tuple(Body(one) if isinstance(one, Mesh) else one for one in obstacles)
        self._options = {
            "surface_tolerance": _number(surface_tolerance, "surface_tolerance [m]", 0.0, 1.0),
            "smoothing": _number(smoothing, "smoothing [m]", 0.0, 1e-3),
            "cache": "" if cache is None else str(cache), "method": method,
            "planes": int(_number(planes, "planes", 1, 1000)),
            "friction": (_number(friction[0], "friction: static coefficient", 0.0, 5.0),
                         _number(friction[1], "friction: dynamic coefficient", 0.0, friction[0])),
            "contacts": contacts, "law": law, "k_p": _number(k_p, "k_p", 0.0, 1e9),
            "energy_stiffness": _number(energy_stiffness, "energy_stiffness [1/s^2]", 0.0, 1e9)}
        if not isinstance(self._tool, Body):
            raise TypeError(f"tool: expected a Body or a Mesh, not {tool!r}")
        bodies: List[dict] = []
        half_spaces: List[dict] = []
        for one in self._obstacles:
            if isinstance(one, HalfSpace):
                half_spaces.append(one._passed())
            elif isinstance(one, Body):
                bodies.append(one._passed("obstacle", len(bodies) + 1))
            else:
                raise TypeError(f"obstacles: expected Body, Mesh or HalfSpace, not {one!r}")
        self._engine = _engine.Engine(self._tool._passed("tool", 1), bodies, half_spaces, self._options)

    def project(self, pose: Any, time: float = 0.0) -> Any:
        """The closest admissible pose, without history; method exact searches the global optimum.

        pose: one pose gives a Projection, a table of N poses gives Projections. time: scene time of the obstacles [s].
        """
        answer = Projections(self._engine.project(poses(pose), float(time)))
        return answer[0] if _is_one(pose) else answer

    def follow(self, path: Any, rate_Hz: float = 1000.0) -> Projections:
        """Follows a trajectory as the daemon does: the proxy never enters or crosses an obstacle.

        path: (N, 7) or (N, 4, 4); pose i has scene time i / rate_Hz [Hz].
        """
        return Projections(self._engine.follow(poses(path), _number(rate_Hz, "rate_Hz", 1e-3, 1e6)))

    def overlaps(self, pose: Any, time: float = 0.0) -> Any:
        """Whether the tool and an obstacle have a common point, or one contains the other. N poses: bool array (N,)."""
        answer = self._engine.overlaps(poses(pose), float(time))
        return bool(answer[0]) if _is_one(pose) else answer

    def clearance(self, pose: Any, time: float = 0.0) -> Any:
        """Distance from the nearest obstacle [m]; 0 if they overlap, inf without obstacles. N poses: array (N,)."""
        answer = self._engine.clearance(poses(pose), float(time))
        return float(answer[0]) if _is_one(pose) else answer

    @property
    def tool(self) -> Body:
        return self._tool

    @property
    def obstacles(self) -> Tuple[Union[Body, HalfSpace], ...]:
        return self._obstacles

    @property
    def tool_properties(self) -> dict:
        """mass [kg], volume [m^3], centre_of_mass (3,) in M [m], inertia (3, 3) [kg m^2] about it."""
        return self._engine.body()

    @property
    def remarks(self) -> List[str]:
        """What differs from the meshes as given (repairs, contact surfaces), and implausible sizes."""
        return [*self._engine.changes(), *self._engine.simplifications(), *self._engine.warnings()]

    def __reduce__(self) -> Any:
        return _scene, (self._tool, self._obstacles, self._options)

    def __repr__(self) -> str:
        return f"<Scene: {self._tool.meshes[0].name}, {len(self._obstacles)} obstacles>"


def _scene(tool: Body, obstacles: Any, options: dict) -> Scene:
    return Scene(tool, obstacles, **options)


def _is_one(pose: Any) -> bool:
    return np.shape(pose) in ((7,), (4, 4))
