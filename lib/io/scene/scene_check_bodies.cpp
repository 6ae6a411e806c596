#include "tunica/io/scene/detail/scene_checks.hpp"
#include "tunica/io/scene/detail/scene_names.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

namespace tunica {
namespace {

void check_radius(const Table<double>& radius, const Places& places) {
  for (const auto& [time, value] : radius.points) {
    places.of("radius").require(value >= 0 && std::isfinite(value),
                                fmt::format("radius is {} mm at {}: it must not be negative", value, time));
  }
}

// The axis of a cylinder tells where its ends are: it must have a direction at all times.
void check_axis(const RigidCylinder& cylinder, const Places& places) {
  std::set<double> times;
  for (const auto* end : {&cylinder.from, &cylinder.to}) {
    for (const auto& [time, point] : end->points) {
      times.insert(time);
    }
  }
  std::optional<Vec3> before;
  for (const double time : times) {
    const Vec3 axis = cylinder.to.at(time) - cylinder.from.at(time);
    places.of("to").require(!axis.isZero(0), "from and to are one point: a cylinder needs an axis");
    // Between two entries the axis goes straight from one to the next: through nothing only where they are opposite.
    places.of("to").require(!before || axis.normalized().dot(before->normalized()) > -1 + 1e-12,
                            "the cylinder's axis turns over by passing through nothing: give the way that it turns");
    before = axis;
  }
}

void check_shape(const RigidSphere& sphere, const Places& places) { check_radius(sphere.radius, places); }
void check_shape(const RigidCapsule& capsule, const Places& places) { check_radius(capsule.radius, places); }
void check_shape(const RigidCylinder& cylinder, const Places& places) {
  check_radius(cylinder.radius, places);
  check_axis(cylinder, places);
}
void check_shape(const RigidPlane& plane, const Places& places) {
  places.of("normal").require(std::abs(plane.normal.norm() - 1) < 1e-9, "normal must be a unit vector");
}
void check_shape(const SceneRigidMesh& mesh, const Places& places) {
  places.of("mesh").require(!mesh.mesh.filename().empty(), "mesh names no file");
  places.of("scale").require(is_positive(mesh.scale), "scale must be greater than zero");
  if (mesh.expansion) {
    for (const auto& [time, factor] : mesh.expansion->factor.points) {
      places.of("expand").require(is_positive(factor),
                                  fmt::format("factor is {} at {}: it must be greater than zero", factor, time));
    }
  }
}

// The body that is carried, the one that carries.
std::pair<std::size_t, std::size_t> bodies_of(const Scene& scene, const SceneAttach& attach) {
  for (const auto& [key, name] : {std::pair("body", &attach.body), std::pair("to", &attach.to)}) {
    attach.places.of(key).require(!rigid_index(scene, *name),
                                  fmt::format("\"{}\" is rigid: only bodies that deform are attached to each other; "
                                              "nodes that move as told are a [[fix]] with displacement",
                                              *name));
  }
  return {body_index(scene, attach.body, attach.places, "body"), body_index(scene, attach.to, attach.places, "to")};
}

}  // namespace

void check_rigid(const SceneRigid& rigid) {
  std::visit([&](const auto& shape) { check_shape(shape, rigid.places); }, rigid.shape);
}

void check_attachments(const Scene& scene) {
  std::map<std::size_t, std::set<std::size_t>> carriers;  // of a body, directly or through others
  for (const SceneAttach& attach : scene.attachments) {
    const auto [body, to] = bodies_of(scene, attach);
    const Places& places = attach.places;
    places.of("to").require(body != to, fmt::format("\"{}\" is attached to itself: name another body", attach.to));
    places.of("side").require(
        !is_solid(scene, to) || (attach.side == Attachment::Side::middle && !places.keys.contains("side")),
        fmt::format("\"{}\" is a solid and has no side: side belongs to an attachment to a shell", attach.to));
    places.of("where").require(!std::holds_alternative<RigidMotions>(attach.where),
                               "rigid_motions belongs to [[fix]]: select nodes");
    if (const auto* touching = std::get_if<TouchingNodes>(&attach.where)) {
      places.of("where").require(touching->distance >= 0, "touching must not be negative");
    }
    places.of("to").require(!carriers[to].contains(body),
                            fmt::format("\"{}\" carries \"{}\" already: bodies cannot carry each other in a circle",
                                        attach.body, attach.to));
    std::set<std::size_t> more = carriers[to];
    more.insert(to);
    for (auto& [carried, by] : carriers) {
      if (carried == body || by.contains(body)) {
        by.insert(more.begin(), more.end());
      }
    }
    carriers[body].insert(more.begin(), more.end());
  }
  for (const SceneFix& fix : scene.fixes) {
    const auto carried = std::find_if(scene.attachments.begin(), scene.attachments.end(),
                                      [&](const SceneAttach& attach) { return attach.body == fix.body; });
    fix.places.of("where").require(
        !std::holds_alternative<RigidMotions>(fix.where) || carried == scene.attachments.end(),
        fmt::format("\"{}\" is carried by \"{}\", so its rigid motions are held already: remove this [[fix]]", fix.body,
                    carried == scene.attachments.end() ? "" : carried->to));
  }
}

void check_contacts(const Scene& scene) {
  std::set<std::pair<std::string, std::string>> pairs;
  for (const SceneContact& contact : scene.contacts) {
    const Places& places = contact.places;
    const auto& [a, b] = contact.between;
    const Place& between = places.of("between");
    const bool rigid_a = party_named(scene, a, between).rigid;
    const bool rigid_b = party_named(scene, b, between).rigid;
    between.require(!rigid_a || a != b,
                    fmt::format("\"{}\" is rigid: it cannot touch itself, name a body that deforms", a));
    between.require(!rigid_a || !rigid_b,
                    fmt::format("\"{}\" and \"{}\" are both rigid: one of the two must deform", a, b));
    between.require(pairs.insert(std::minmax(a, b)).second,
                    fmt::format("there are two contacts between \"{}\" and \"{}\": keep one", a, b));
    places.of("friction")
        .require(contact.friction >= 0 && std::isfinite(contact.friction), "friction must not be negative");
    places.of("resolution")
        .require(contact.resolution > 0 && contact.resolution <= 0.5, "resolution must be above 0 and at most 50%");
  }
}

}  // namespace tunica
