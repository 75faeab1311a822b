// SPDX-License-Identifier: GPL-3.0-or-later
// The extension module wrenchd._engine: NumPy arrays in, arrays out. The classes that users see are in
// ../wrenchd/engine.py; they check shapes and own the docstrings.
#include <algorithm>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "collision/meshes/mesh_check.hpp"
#include "collision/meshes/mesh_file.hpp"
#include "collision/meshes/mesh_loader.hpp"
#include "collision/meshes/mesh_source.hpp"
#include "collision/pose_solver.hpp"
#include "collision/scene.hpp"
#include "collision/touch.hpp"
#include "core/energy_law.hpp"

namespace py = pybind11;

namespace wrenchd {
namespace {

using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Indices = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;

PolygonSoup soup_from(const Array& vertices, const Indices& corners, const Indices& sizes) {
  PolygonSoup soup;
  const auto v = vertices.unchecked<2>();
  for (py::ssize_t i = 0; i < v.shape(0); ++i) soup.vertices.emplace_back(v(i, 0), v(i, 1), v(i, 2));
  const auto c = corners.unchecked<1>();
  const auto n = sizes.unchecked<1>();
  py::ssize_t at = 0;
  for (py::ssize_t f = 0; f < n.shape(0); ++f) {
    if (n(f) < 0 || at + n(f) > c.shape(0))
      throw std::invalid_argument("faces: the sizes do not match the corners");
    std::vector<std::size_t> face;
    // A negative index becomes a huge one, which the check of the mesh reports.
    for (const py::ssize_t end = at + n(f); at < end; ++at) face.push_back(static_cast<std::size_t>(c(at)));
    soup.faces.push_back(std::move(face));
  }
  return soup;
}

py::tuple arrays_of(const PolygonSoup& soup) {
  Array vertices({static_cast<py::ssize_t>(soup.vertices.size()), py::ssize_t{3}});
  auto v = vertices.mutable_unchecked<2>();
  for (std::size_t i = 0; i < soup.vertices.size(); ++i)
    for (int k = 0; k < 3; ++k) v(static_cast<py::ssize_t>(i), k) = soup.vertices[i][k];
  std::vector<std::int64_t> corners, sizes;
  for (const auto& face : soup.faces) {
    sizes.push_back(static_cast<std::int64_t>(face.size()));
    for (const std::size_t corner : face) corners.push_back(static_cast<std::int64_t>(corner));
  }
  return py::make_tuple(vertices, Indices(static_cast<py::ssize_t>(corners.size()), corners.data()),
                        Indices(static_cast<py::ssize_t>(sizes.size()), sizes.data()));
}

PolygonSoup soup_of(const TriangleMesh& mesh) {
  PolygonSoup soup{mesh.vertices_m, {}};
  for (const auto& [a, b, c] : mesh.triangles) soup.faces.push_back({a, b, c});
  return soup;
}

BodyKind kind_from(const std::string& kind) {
  if (kind == "solid") return BodyKind::solid;
  if (kind == "surface") return BodyKind::surface;
  throw std::invalid_argument("kind: \"solid\" or \"surface\", not \"" + kind + "\"");
}

/// Returns a report as a dictionary, and the repaired mesh, or None if the mesh cannot be used.
py::tuple check_mesh(const Array& vertices, const Indices& corners, const Indices& sizes,
                     const std::string& kind, const std::string& name) {
  PolygonSoup soup = soup_from(vertices, corners, sizes);
  const BodyKind body_kind = kind_from(kind);
  TriangleMesh mesh;
  MeshReport report;
  std::string rejection;
  {
    const py::gil_scoped_release release;
    report = body_kind == BodyKind::solid ? repair_and_check_solid(soup, &mesh)
                                          : repair_and_check_surface(soup, &mesh);
    if (!report.defects.empty()) rejection = rejection_text(name, soup, body_kind, report);
  }
  py::dict out;
  out["vertices"] = report.vertices, out["faces"] = report.faces;
  out["closed"] = report.closed, out["consistent"] = report.consistent, out["outward"] = report.outward;
  out["self_intersecting"] = report.self_intersecting, out["volume"] = report.volume;
  out["tolerated"] = report.tolerated, out["repairs"] = report.repairs, out["defects"] = report.defects;
  out["text"] = rejection;
  if (!report.defects.empty()) return py::make_tuple(out, py::none());
  return py::make_tuple(out, arrays_of(soup_of(mesh)));
}

py::tuple read_mesh(const std::string& file) {
  PolygonSoup soup;
  {
    const py::gil_scoped_release release;
    soup = parse_mesh(read_mesh_source(file));
  }
  return arrays_of(soup);
}

/// Returns the pose of seven numbers, with the quaternion normalized as wrenchctl does.
Pose pose_from(const double* numbers) {
  PoseNumbers x{};
  std::copy(numbers, numbers + x.size(), x.begin());
  Pose pose = pose_from_numbers(x);
  pose.rotation.normalize();
  return pose;
}

Vector3d vector_from(const py::handle& numbers) {
  return numbers.cast<Vector3d>();
}

const std::map<std::string, InertiaSource> kInertiaSources = {{"solid", InertiaSource::solid},
                                                              {"hull", InertiaSource::hull},
                                                              {"shell", InertiaSource::shell},
                                                              {"given", InertiaSource::given}};
const std::map<std::string, Method> kMethods = {{"exact", Method::exact},
                                                {"planar", Method::planar},
                                                {"descent", Method::descent},
                                                {"translational", Method::translational}};

template <class Value>
Value choice(const std::map<std::string, Value>& choices, const std::string& option,
             const std::string& value) {
  if (const auto found = choices.find(value); found != choices.end()) return found->second;
  std::string names;
  for (const auto& [name, unused] : choices) names += (names.empty() ? "" : ", ") + name;
  throw std::invalid_argument(option + ": one of " + names + "; not \"" + value + "\"");
}

/// What one pose gave, without the room that a SolvedPose has for contacts.
struct Row {
  Pose X_WM;
  Vector6d eps, gradient;
  Wrench F_T, F_S;
  double energy, kkt_residual, solve_ns;
  std::uint16_t contacts, iterations;
  bool proven_global;
  ProjectionStatus status;
};

/// The contacts of a table of poses. Python objects are made only for the rows that a program reads.
class ContactRows {
 public:
  explicit ContactRows(std::shared_ptr<const Scene> scene) : scene_(std::move(scene)) {}

  void add(const Touches& touches) {
    all_.insert(all_.end(), touches.begin(), touches.end());
    ends_.push_back(all_.size());
  }
  std::size_t size() const { return ends_.size(); }
  /// One tuple a contact: point, normal, multiplier, load fraction, obstacle, tool feature, obstacle feature.
  py::list row(py::ssize_t i) const {
    const auto n = static_cast<py::ssize_t>(ends_.size());
    if (i < -n || i >= n) throw py::index_error("no pose " + std::to_string(i) + " of " + std::to_string(n));
    const auto at = static_cast<std::size_t>(i < 0 ? i + n : i);
    py::list out;
    for (std::size_t k = at == 0 ? 0 : ends_[at - 1]; k < ends_[at]; ++k) {
      const Touch& touch = all_[k];
      const auto feature = [](std::uint8_t kind, std::uint32_t first, std::uint32_t second) {
        return text(Feature{static_cast<FeatureKind>(kind), first, second});
      };
      out.append(py::make_tuple(
          py::array_t<double>(3, touch.point_W_m.data()), py::array_t<double>(3, touch.normal_W.data()),
          touch.multiplier_kg_m, touch.load_fraction, obstacle_name(*scene_, touch.obstacle),
          feature(touch.tool_feature_kind, touch.tool_first, touch.tool_second),
          feature(touch.obstacle_feature_kind, touch.obstacle_first, touch.obstacle_second)));
    }
    return out;
  }

 private:
  std::shared_ptr<const Scene> scene_;
  std::vector<Touch> all_;
  std::vector<std::size_t> ends_;  ///< end of each pose's contacts in all_
};

/// What a trajectory or a table of poses gave.
struct Rows {
  explicit Rows(std::shared_ptr<const Scene> scene) : contacts(std::move(scene)) {}
  std::vector<Row> rows;
  ContactRows contacts;
};

/// The scene with its solver. Several Python threads may share it: a mutex keeps their calls apart, and the
/// interpreter's lock is free meanwhile.
class Engine {
 public:
  Engine(const py::dict& tool, const py::list& obstacles, const py::list& half_spaces,
         const py::dict& options)
      : loader_(options["cache"].cast<std::string>(), {}) {
    SceneSettings settings;
    settings.tool = tool_settings(tool);
    for (const py::handle& obstacle : obstacles)
      settings.meshes.push_back(obstacle_settings(obstacle.cast<py::dict>()));
    for (const py::handle& half_space : half_spaces) {
      const auto given = half_space.cast<py::dict>();
      const Vector3d normal_W = vector_from(given["normal"]);
      const double length = normal_W.norm();  // the set of points does not depend on it
      settings.half_spaces.push_back(
          {given["name"].cast<std::string>(), normal_W / length, given["offset"].cast<double>() / length});
    }
    settings.surface_tolerance_m = options["surface_tolerance"].cast<double>();
    settings.smoothing_m = options["smoothing"].cast<double>();
    solve_.depth.method = choice(kMethods, "method", options["method"].cast<std::string>());
    solve_.depth.planes = options["planes"].cast<int>();
    solve_.depth.friction.static_coefficient = options["friction"].cast<std::pair<double, double>>().first;
    solve_.depth.friction.dynamic_coefficient = options["friction"].cast<std::pair<double, double>>().second;
    solve_.depth.contacts =
        choice<ContactBackend>({{"native", ContactBackend::native}, {"cgal", ContactBackend::cgal}},
                               "contacts", options["contacts"].cast<std::string>());
    solve_.law = choice<SpringLaw>({{"pid", SpringLaw::pid}, {"energy", SpringLaw::energy}}, "law",
                                   options["law"].cast<std::string>());
    solve_.k_P = options["k_p"].cast<double>();
    solve_.energy_stiffness_per_s2 = options["energy_stiffness"].cast<double>();
    const py::gil_scoped_release release;
    scene_ = std::make_shared<const Scene>(settings, loader_);
    solver_ = std::make_unique<PoseSolver>(*scene_, solve_);
  }

  py::object project(const Array& poses, double time_s) {
    const std::vector<Pose> X_WM = poses_from(poses);
    Rows rows(scene_);
    {
      const py::gil_scoped_release release;
      const std::lock_guard lock(mutex_);
      for (const Pose& X : X_WM) add(rows, X, solver_->project(X, time_s));
    }
    return columns_of(std::move(rows));
  }
  py::object follow(const Array& poses, double rate_Hz) {
    const std::vector<Pose> X_WM = poses_from(poses);
    Rows rows(scene_);
    {
      const py::gil_scoped_release release;
      const std::lock_guard lock(mutex_);
      solver_->follow(X_WM, rate_Hz, [&](const Pose& X, const SolvedPose& solved) { add(rows, X, solved); });
    }
    return columns_of(std::move(rows));
  }
  py::array overlaps(const Array& poses, double time_s) {
    return each<bool>(poses, [&](const Pose& X) { return solver_->overlaps(X, time_s); });
  }
  py::array clearance(const Array& poses, double time_s) {
    return each<double>(poses, [&](const Pose& X) { return solver_->clearance_m(X, time_s); });
  }
  py::dict body() const {
    const SolidProperties& solid = scene_->tool().solid;
    py::dict out;
    out["mass"] = solid.inertia.mass_kg;
    out["volume"] = solid.volume_m3;
    out["centre_of_mass"] = solid.p_MT_m;
    out["inertia"] = solid.inertia.H_kg_m2;
    return out;
  }
  std::vector<std::string> changes() const { return loader_.changes(); }
  std::vector<std::string> simplifications() const { return loader_.simplifications(); }
  std::vector<std::string> warnings() const { return loader_.warnings(); }

 private:
  /// Adds the meshes of a body to the loader under names of their own. Returns these names.
  std::vector<std::filesystem::path> add_meshes(const py::dict& body) {
    std::vector<std::filesystem::path> names;
    for (const py::handle& part : body["meshes"].cast<py::list>()) {
      const auto mesh = part.cast<py::dict>();
      // Equal names of different meshes stay apart; equal meshes are loaded once.
      std::string name = mesh["name"].cast<std::string>();
      const auto id = mesh["id"].cast<std::uint64_t>();
      const auto [known, is_new] = names_.try_emplace(id, name);
      if (is_new) {
        while (!used_.insert(name).second) name += "'";
        known->second = name;
        loader_.add(name, soup_from(mesh["vertices"].cast<Array>(), mesh["corners"].cast<Indices>(),
                                    mesh["sizes"].cast<Indices>()));
      }
      names.emplace_back(known->second);
    }
    return names;
  }
  ToolSettings tool_settings(const py::dict& body) {
    ToolSettings tool;
    std::vector<std::filesystem::path> parts = add_meshes(body);
    tool.mesh = parts.front();
    if (parts.size() > 1) tool.parts = std::move(parts);
    tool.scale = body["scale"].cast<double>();
    tool.mass_kg = body["mass"].cast<double>();
    tool.kind = kind_from(body["kind"].cast<std::string>());
    tool.inertia_source = choice(kInertiaSources, "inertia", body["inertia"].cast<std::string>());
    tool.shell_thickness_m = body["shell_thickness"].cast<double>();
    tool.centre_of_mass_m = vector_from(body["centre_of_mass"]);
    tool.inertia_kg_m2 = body["inertia_tensor"].cast<Matrix3d>();
    return tool;
  }
  MeshObstacleSettings obstacle_settings(const py::dict& body) {
    MeshObstacleSettings obstacle;
    std::vector<std::filesystem::path> parts = add_meshes(body);
    obstacle.name = body["name"].cast<std::string>();
    obstacle.mesh = parts.front();
    if (parts.size() > 1) obstacle.parts = std::move(parts);
    obstacle.scale = body["scale"].cast<double>();
    obstacle.kind = kind_from(body["kind"].cast<std::string>());
    obstacle.X_WM = pose_from(body["pose"].cast<Array>().data());
    obstacle.motion.linear_m_per_s = vector_from(body["linear_velocity"]);
    obstacle.motion.angular_rad_per_s = vector_from(body["angular_velocity"]);
    return obstacle;
  }

  static std::vector<Pose> poses_from(const Array& poses) {
    std::vector<Pose> out;
    for (py::ssize_t i = 0; i < poses.shape(0); ++i) out.push_back(pose_from(poses.data(i, 0)));
    return out;
  }
  template <class Value, class Function>
  py::array each(const Array& poses, const Function& function) {
    const std::vector<Pose> X_WM = poses_from(poses);
    py::array_t<Value> out(static_cast<py::ssize_t>(X_WM.size()));
    Value* const to = out.mutable_data();
    const py::gil_scoped_release release;
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < X_WM.size(); ++i) to[i] = function(X_WM[i]);
    return out;
  }

  void add(Rows& rows, const Pose& X_WM, const SolvedPose& solved) const {
    const Projection& projection = solved.penetration.projection;
    const ToolBody& tool = scene_->tool();
    Vector6d gradient = Vector6d::Zero();
    if (projection.status != ProjectionStatus::free) {
      // The energy law with k = 2 is the potential T, and its wrench is minus the gradient of T.
      const Wrench F = energy_wrench(tool.solid.inertia, 2.0, X_WM * tool.X_MT(), projection.X_WQ);
      gradient << -F.force_N, -F.torque_Nm;
    }
    rows.rows.push_back({solved.X_WM, solved.penetration.eps, gradient, solved.F_T, solved.F_S,
                         projection.energy, projection.kkt_residual, solved.solve_ns,
                         solved.penetration.contacts, projection.iterations, projection.proven_global,
                         projection.status});
    rows.contacts.add(touches(projection, *scene_, solver_->uses_mesh_features()));
  }

  static py::object columns_of(Rows table) {
    const auto n = static_cast<py::ssize_t>(table.rows.size());
    Array pose({n, py::ssize_t{7}}), eps({n, py::ssize_t{6}}), wrench({n, py::ssize_t{6}}),
        spatial({n, py::ssize_t{6}}), gradient({n, py::ssize_t{6}}), energy(n), residual(n), solve_ns(n);
    py::array_t<std::int64_t> contacts(n), iterations(n);
    py::array_t<bool> proven(n);
    py::list status(n);
    std::map<ProjectionStatus, py::str> names;
    for (py::ssize_t i = 0; i < n; ++i) {
      const Row& row = table.rows[static_cast<std::size_t>(i)];
      const PoseNumbers x = numbers_of(row.X_WM);
      std::copy(x.begin(), x.end(), pose.mutable_data(i, 0));
      const auto put = [i](Array& to, const Vector3d& first, const Vector3d& second) {
        for (int k = 0; k < 3; ++k) *to.mutable_data(i, k) = first[k], *to.mutable_data(i, k + 3) = second[k];
      };
      put(eps, row.eps.head<3>(), row.eps.tail<3>());
      put(wrench, row.F_T.force_N, row.F_T.torque_Nm);
      put(spatial, row.F_S.force_N, row.F_S.torque_Nm);
      put(gradient, row.gradient.head<3>(), row.gradient.tail<3>());
      *energy.mutable_data(i) = row.energy;
      *residual.mutable_data(i) = row.kkt_residual;
      *solve_ns.mutable_data(i) = row.solve_ns;
      *contacts.mutable_data(i) = row.contacts;
      *iterations.mutable_data(i) = row.iterations;
      *proven.mutable_data(i) = row.proven_global;
      status[static_cast<std::size_t>(i)] =
          names.try_emplace(row.status, status_name(row.status)).first->second;
    }
    py::dict out;
    out["pose"] = pose, out["energy"] = energy, out["eps"] = eps, out["wrench"] = wrench;
    out["spatial_wrench"] = spatial, out["gradient"] = gradient, out["kkt_residual"] = residual;
    out["solve_ns"] = solve_ns, out["contact_count"] = contacts, out["iterations"] = iterations;
    out["proven_global"] = proven, out["status"] = status, out["contacts"] = std::move(table.contacts);
    return out;
  }

  MeshLoader loader_;
  std::map<std::uint64_t, std::string> names_;  ///< name of each mesh that was added
  std::set<std::string> used_;
  SolveSettings solve_;
  std::shared_ptr<const Scene> scene_;
  std::unique_ptr<PoseSolver> solver_;
  std::mutex mutex_;
};

}  // namespace
}  // namespace wrenchd

PYBIND11_MODULE(_engine, module) {
  using namespace wrenchd;
  module.doc() = "The contact and projection engine of wrenchd; use it through the package wrenchd.";
  py::register_exception<MeshError>(module, "MeshError", PyExc_ValueError);
  module.def("read_mesh", &read_mesh);
  module.def("check_mesh", &check_mesh);
  py::class_<ContactRows>(module, "ContactRows")
      .def("__len__", &ContactRows::size)
      .def("__getitem__", &ContactRows::row);
  py::class_<Engine>(module, "Engine")
      .def(py::init<const py::dict&, const py::list&, const py::list&, const py::dict&>())
      .def("project", &Engine::project)
      .def("follow", &Engine::follow)
      .def("overlaps", &Engine::overlaps)
      .def("clearance", &Engine::clearance)
      .def("body", &Engine::body)
      .def("changes", &Engine::changes)
      .def("simplifications", &Engine::simplifications)
      .def("warnings", &Engine::warnings);
}
