// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/urdf_reader.hpp"

#include <cmath>
#include <cstdint>
#include <optional>
#include <set>
#include <sstream>

#include <boost/property_tree/ptree.hpp>
#include <boost/property_tree/xml_parser.hpp>

#include "collision/meshes/mesh_source.hpp"
#include "collision/meshes/packer.hpp"
#include "config/nearest_key.hpp"
#include "tools/import/import_error.hpp"
#include "tools/import/length.hpp"

namespace wrenchd {
namespace {

using Element = boost::property_tree::ptree;

std::optional<std::string> attribute(const Element& element, const char* name) {
  const auto found = element.get_optional<std::string>(std::string("<xmlattr>.") + name);
  return found ? std::optional(*found) : std::nullopt;
}

std::string required(const Element& element, const char* name, const std::string& place) {
  const auto value = attribute(element, name);
  if (!value || value->empty()) throw ImportError(place + ": has no attribute '" + name + "'; add it");
  return *value;
}

double number(const std::string& word, const std::string& place) {
  const auto x = parse_number(word);
  if (!x) throw ImportError(place + ": '" + printable_name(word) + "' is no finite number; correct it");
  return *x;
}

Vector3d vector_from(const std::string& text, const std::string& place) {
  std::vector<std::string_view> words;
  split_words(text, words);
  if (words.size() != 3)
    throw ImportError(place + ": expected three numbers, found '" + printable_name(text) + "'; correct it");
  Vector3d v;
  for (std::size_t k = 0; k < 3; ++k) v[static_cast<int>(k)] = number(std::string(words[k]), place);
  return v;
}

double positive(const Element& element, const char* name, const std::string& place) {
  const double x = number(required(element, name, place), place + ", " + name);
  if (!(x > 0.0)) throw ImportError(place + ": " + name + " is not above 0; correct it");
  return x;
}

/// Reads <origin xyz rpy>: a rotation about the fixed axes x, y and z, one after the other.
Pose origin(const Element& parent, const std::string& place) {
  const auto element = parent.get_child_optional("origin");
  Pose X;
  if (!element) return X;
  if (const auto xyz = attribute(*element, "xyz"))
    X.translation_m = vector_from(*xyz, place + ", origin xyz");
  if (const auto rpy = attribute(*element, "rpy")) {
    const Vector3d a = vector_from(*rpy, place + ", origin rpy");
    X.rotation = rotation_from(a.z() * Vector3d::UnitZ()) * rotation_from(a.y() * Vector3d::UnitY()) *
                 rotation_from(a.x() * Vector3d::UnitX());
  }
  return X;
}

struct Joint {
  std::string name, type, parent, child;
  Pose X_PJ;  ///< P: parent link, J: child link at position 0
  Vector3d axis = Vector3d::UnitX();
  std::optional<double> lower, upper;
  std::string mimic;
  double multiplier = 1.0, offset = 0.0;

  bool rotates() const { return type == "revolute" || type == "continuous"; }
  bool moves() const { return rotates() || type == "prismatic"; }
};

Joint read_joint(const Element& element) {
  Joint joint;
  joint.name = required(element, "name", "a joint");
  const std::string place = "joint '" + printable_name(joint.name) + "'";
  joint.type = required(element, "type", place);
  const std::set<std::string> types = {"revolute", "continuous", "prismatic", "fixed", "floating", "planar"};
  if (types.count(joint.type) == 0)
    throw ImportError(place + ": unknown type '" + printable_name(joint.type) +
                      "'; use revolute, continuous, prismatic, fixed, floating or planar");
  for (const auto& [key, target] : {std::pair{"parent", &joint.parent}, {"child", &joint.child}}) {
    const auto link = element.get_child_optional(key);
    if (!link) throw ImportError(place + ": has no <" + std::string(key) + ">; add it");
    *target = required(*link, "link", place + ", " + key);
  }
  joint.X_PJ = origin(element, place);
  if (const auto axis = element.get_child_optional("axis")) {
    joint.axis = vector_from(required(*axis, "xyz", place + ", axis"), place + ", axis");
    if (!(joint.axis.norm() > 1e-9)) throw ImportError(place + ": its axis is zero; correct it");
  }
  joint.axis.normalize();
  if (const auto limit = element.get_child_optional("limit"); limit && joint.type != "continuous") {
    if (const auto x = attribute(*limit, "lower")) joint.lower = number(*x, place + ", lower");
    if (const auto x = attribute(*limit, "upper")) joint.upper = number(*x, place + ", upper");
  }
  if (const auto mimic = element.get_child_optional("mimic")) {
    joint.mimic = required(*mimic, "joint", place + ", mimic");
    if (const auto x = attribute(*mimic, "multiplier")) joint.multiplier = number(*x, place + ", multiplier");
    if (const auto x = attribute(*mimic, "offset")) joint.offset = number(*x, place + ", offset");
  }
  return joint;
}

void read_geometry(const Element& collision, const std::string& place, UrdfShape& shape) {
  const auto geometry = collision.get_child_optional("geometry");
  if (!geometry) throw ImportError(place + ": has no <geometry>; add it");
  if (const auto mesh = geometry->get_child_optional("mesh")) {
    shape.kind = UrdfShape::Kind::mesh;
    shape.mesh = required(*mesh, "filename", place + ", mesh");
    if (const auto scale = attribute(*mesh, "scale")) shape.scale = vector_from(*scale, place + ", scale");
    if (shape.scale.cwiseAbs().minCoeff() <= 0.0) throw ImportError(place + ": a scale is 0; correct it");
  } else if (const auto box = geometry->get_child_optional("box")) {
    shape.kind = UrdfShape::Kind::box;
    shape.size_m = vector_from(required(*box, "size", place + ", box"), place + ", size");
    if (shape.size_m.minCoeff() <= 0.0) throw ImportError(place + ": a side is not above 0; correct it");
  } else if (const auto cylinder = geometry->get_child_optional("cylinder")) {
    shape.kind = UrdfShape::Kind::cylinder;
    shape.size_m = {positive(*cylinder, "radius", place), positive(*cylinder, "length", place), 0.0};
  } else if (const auto sphere = geometry->get_child_optional("sphere")) {
    shape.kind = UrdfShape::Kind::sphere;
    shape.size_m = {positive(*sphere, "radius", place), 0.0, 0.0};
  } else {
    throw ImportError(place + ": its geometry is no mesh, box, cylinder or sphere; use one of them");
  }
}

/// The links and joints of a robot.
class Tree {
 public:
  explicit Tree(const Element& robot) {
    for (const auto& [key, element] : robot) {
      if (key == "link") {
        const std::string name = required(element, "name", "a link");
        if (!links_.emplace(name, &element).second)
          throw ImportError("link '" + printable_name(name) + "' comes twice; rename one of them");
        order_.push_back(name);
      } else if (key == "joint") {
        Joint joint = read_joint(element);
        if (!joints_.emplace(joint.name, joint).second)
          throw ImportError("joint '" + printable_name(joint.name) + "' comes twice; rename one of them");
      }
    }
    for (const auto& [name, joint] : joints_) {
      const std::string place = "joint '" + printable_name(name) + "'";
      for (const std::string& link : {joint.parent, joint.child})
        if (links_.count(link) == 0)
          throw ImportError(place + ": there is no link '" + printable_name(link) + "'; correct the name");
      if (!above_.emplace(joint.child, &joint).second)
        throw ImportError(place + ": link '" + printable_name(joint.child) +
                          "' is the child of another joint too; a link has one parent");
    }
  }

  void set(const std::map<std::string, double>& positions) {
    std::vector<KnownKey> movable;
    for (const auto& [name, joint] : joints_)
      if (joint.moves() && joint.mimic.empty()) movable.push_back({name, ""});
    for (const auto& [name, position] : positions) {
      const auto found = joints_.find(name);
      if (found == joints_.end() || !found->second.moves() || !found->second.mimic.empty())
        throw ImportError("--joint " + printable_name(name) + ": no joint of this name can be set; " +
                          (movable.empty() ? "leave it out" : nearest_key(name, movable).advice));
      const Joint& joint = found->second;
      if ((joint.lower && position < *joint.lower) || (joint.upper && position > *joint.upper))
        throw ImportError("--joint " + name + ": " + short_number(position) + " is outside of " +
                          (joint.lower ? short_number(*joint.lower) : "-inf") + " to " +
                          (joint.upper ? short_number(*joint.upper) : "inf") +
                          (joint.rotates() ? " rad" : " m") + "; choose a position within");
    }
    positions_ = positions;
  }

  const std::vector<std::string>& links() const { return order_; }
  const Element& link(const std::string& name) const { return *links_.at(name); }

  /// Returns the pose of a link in the root link. Throws ImportError if the joints form a ring.
  Pose pose(const std::string& link) const {
    Pose X;
    std::string at = link;
    for (std::size_t steps = 0;; ++steps) {
      if (steps > joints_.size())
        throw ImportError("link '" + printable_name(link) + "': its joints form a ring; correct a parent");
      const auto joint = above_.find(at);
      if (joint == above_.end()) return X;
      X = joint->second->X_PJ * moved(*joint->second) * X;
      at = joint->second->parent;
    }
  }

  std::vector<std::string> roots() const {
    std::vector<std::string> all;
    for (const std::string& link : order_)
      if (above_.count(link) == 0) all.push_back(link);
    return all;
  }

 private:
  double position(const Joint& joint, int depth = 0) const {
    if (const auto given = positions_.find(joint.name); given != positions_.end()) return given->second;
    if (joint.mimic.empty()) return 0.0;
    const auto leader = joints_.find(joint.mimic);
    constexpr int kMostLeaders = 100;
    if (leader == joints_.end() || depth > kMostLeaders)
      throw ImportError("joint '" + printable_name(joint.name) + "': mimics '" + printable_name(joint.mimic) +
                        "', which is no joint that can be followed; correct the name");
    return joint.multiplier * position(leader->second, depth + 1) + joint.offset;
  }

  Pose moved(const Joint& joint) const {
    Pose X;
    if (!joint.moves()) return X;
    const double q = position(joint);
    if (joint.rotates())
      X.rotation = rotation_from(std::remainder(q, 2.0 * M_PI) * joint.axis);
    else
      X.translation_m = q * joint.axis;
    return X;
  }

  std::map<std::string, const Element*> links_;
  std::vector<std::string> order_;
  std::map<std::string, Joint> joints_;
  std::map<std::string, const Joint*> above_;  ///< by the child link
  std::map<std::string, double> positions_;
};

Element parse_xml(const std::string& bytes) {
  Element document;
  try {
    std::istringstream stream(bytes);
    boost::property_tree::read_xml(stream, document);
  } catch (const boost::property_tree::xml_parser_error& error) {
    throw ImportError("line " + std::to_string(error.line()) + ": is no XML (" +
                      printable_name(error.message()) + "); correct it, or process it with xacro first");
  }
  return document;
}

}  // namespace

UrdfRobot read_urdf(const std::string& bytes, const std::map<std::string, double>& joints) {
  const Element document = parse_xml(bytes);
  const auto root = document.get_child_optional("robot");
  if (!root) throw ImportError("has no <robot>; name a URDF file, or process it with xacro first");
  Tree tree(*root);
  tree.set(joints);
  if (const auto roots = tree.roots(); roots.size() != 1) {
    if (roots.empty()) throw ImportError("has no root link; one link must be the child of no joint");
    throw ImportError("has several root links, '" + printable_name(roots[0]) + "' and '" +
                      printable_name(roots[1]) + "'; join them with a joint");
  }
  UrdfRobot robot;
  robot.name = printable_name(attribute(*root, "name").value_or("robot"));
  std::size_t bare = 0;
  for (const std::string& link : tree.links()) {
    const Pose X_WL = tree.pose(link);
    int count = 0;
    for (const auto& [key, element] : tree.link(link)) {
      if (key != "collision") continue;
      UrdfShape& shape = robot.shapes.emplace_back();
      shape.link = printable_name(link);
      shape.name = ++count == 1 ? shape.link : shape.link + "-" + std::to_string(count);
      const std::string place = "link '" + shape.link + "', collision " + std::to_string(count);
      shape.X_WS = X_WL * origin(element, place);
      read_geometry(element, place, shape);
    }
    if (count == 0 && tree.link(link).get_child_optional("visual")) ++bare;
  }
  if (bare > 0)
    robot.remarks.push_back(std::to_string(bare) +
                            " links have a visual, but no collision element; they are no obstacles");
  if (robot.shapes.empty())
    throw ImportError("has no <collision> element; add one to each link that is an obstacle");
  return robot;
}

std::string packed(const UrdfRobot& robot) {
  std::string bytes;
  const Packer pack(bytes);
  pack(robot.name);
  pack(robot.remarks);
  pack(static_cast<std::uint64_t>(robot.shapes.size()));
  for (const UrdfShape& shape : robot.shapes) {
    pack(shape.link);
    pack(shape.name);
    pack(shape.kind);
    pack(shape.mesh);
    pack(shape.scale);
    pack(shape.size_m);
    pack(numbers_of(shape.X_WS));
  }
  return bytes;
}

bool unpack(const std::string& bytes, UrdfRobot& robot) {
  const Unpacker take(bytes);
  std::uint64_t shapes = 0;
  take(robot.name);
  take(robot.remarks);
  take(shapes);
  for (std::uint64_t i = 0; i < shapes && take.good(); ++i) {
    UrdfShape& shape = robot.shapes.emplace_back();
    PoseNumbers pose{};
    take(shape.link);
    take(shape.name);
    take(shape.kind);
    take(shape.mesh);
    take(shape.scale);
    take(shape.size_m);
    take(pose);
    if (take.good()) shape.X_WS = pose_from_numbers(pose);
  }
  return take.at_end();
}

}  // namespace wrenchd
