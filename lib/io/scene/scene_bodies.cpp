#include "tunica/io/scene/detail/scene_parts.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tunica {
namespace {

// What makes millimetres of a mesh's coordinates.
template <typename Body>
void read_size(const SceneTable& table, Body& body) {
  if (table.has("unit")) {
    try {
      body.unit_mm = parse_length_unit(table.text("unit"));
    } catch (const UsageError& error) {
      table.place("unit").fail(fmt::format("unit: {}", error.what()));
    }
  }
  if (table.has("scale")) {
    body.scale = table.number("scale");
  }
}

/// @param needs_young  else it may be left out, where nothing depends on it
Material read_material(const SceneTable& table, bool needs_young) {
  Material material;
  material.young_stated = needs_young || table.has("young");
  material.young = material.young_stated ? table.quantity("young", dimension::pressure) : any_young;
  material.poisson = table.number("poisson");
  if (table.has("density")) {
    material.density = table.quantity("density", dimension::density);
  }
  return material;
}

// Three plain numbers, made a unit vector.
Vec3 read_direction(const SceneTable& table, std::string_view key) {
  constexpr std::string_view like = "[0.0, 0.0, 1.0]";
  const toml::array& numbers = table.array(key, like);
  if (numbers.size() != 3) {
    table.place(key).fail(fmt::format("{} must be a list of three numbers, for example {}", key, like));
  }
  Vec3 direction;
  for (std::size_t i = 0; i < 3; ++i) {
    direction[i] = table.number_of(numbers[i], key);
  }
  table.place(key).require(!direction.isZero(0), fmt::format("{} is zero and has no direction", key));
  // What is unit stays as it is, to the last bit: a scene that was written is read as it was.
  return std::abs(direction.squaredNorm() - 1) > 4e-15 ? Vec3(direction.stableNormalized()) : direction;
}

// The values of one rigid body over time.
class RigidReader {
public:
  RigidReader(const SceneTable& table, bool dynamic, Scene& scene) : table_(table), dynamic_(dynamic), scene_(scene) {}

  [[nodiscard]] Table<Vec3> points(std::string_view key) {
    return read_table<Vec3>(table_, key, like_point, dynamic_, scene_, [this, key](const toml::node& node) {
      return table_.vector_of(node, key, dimension::length, like_point);
    });
  }
  [[nodiscard]] Table<double> radius() {
    static constexpr std::string_view key = "radius";
    return read_table<double>(table_, key, R"("1mm")", dynamic_, scene_, [this](const toml::node& node) {
      const double radius = table_.quantity_of(node, key, dimension::length);
      table_.at(node.source()).require(radius >= 0, "radius must not be negative");
      return radius;
    });
  }
  [[nodiscard]] RigidMesh::Turn turn() {
    constexpr std::array<std::string_view, 3> keys{"point", "axis", "angle"};
    constexpr std::string_view like =
        R"({point = ["0mm", "0mm", "0mm"], axis = [0.0, 0.0, 1.0], angle = [["0s", 0.0], ["1s", 90.0]]})";
    const SceneTable inner(table_.table("turn", like), table_.file(), "turn", keys);
    return {inner.vector("point", dimension::length, like_point), read_direction(inner, "axis"),
            read_table<double>(inner, "angle", "90.0", dynamic_, scene_, [&](const toml::node& node) {
              return inner.number_of(node, "angle") * std::numbers::pi / 180;
            })};
  }
  [[nodiscard]] RigidMesh::Expansion expansion() {
    constexpr std::array<std::string_view, 3> keys{"point", "axis", "factor"};
    constexpr std::string_view like =
        R"({point = ["0mm", "0mm", "0mm"], axis = [0.0, 0.0, 1.0], factor = [["0s", 1.0], ["1s", 1.5]]})";
    const SceneTable inner(table_.table("expand", like), table_.file(), "expand", keys);
    return {inner.vector("point", dimension::length, like_point), read_direction(inner, "axis"),
            read_table<double>(inner, "factor", "1.5", dynamic_, scene_, [&](const toml::node& node) {
              const double factor = inner.number_of(node, "factor");
              inner.at(node.source()).require(factor > 0, "factor must be greater than zero");
              return factor;
            })};
  }

private:
  const SceneTable& table_;
  bool dynamic_;
  Scene& scene_;
};

enum class Shape { sphere, capsule, cylinder, plane, mesh };

// Each shape has its keys; `name` and `motion` belong to all.
void refuse_keys_of_others(const SceneTable& table, std::string_view shape) {
  const std::initializer_list<std::pair<std::string_view, std::string_view>> owners{
      {"centre", "sphere"},
      {"radius", "sphere, capsule, cylinder"},
      {"from", "capsule, cylinder"},
      {"to", "capsule, cylinder"},
      {"point", "plane"},
      {"normal", "plane"},
      {"unit", "mesh"},
      {"scale", "mesh"},
      {"turn", "mesh"},
      {"expand", "mesh"}};
  for (const auto& [key, of] : owners) {
    table.place(key).require(
        !table.has(key) || of.find(shape) != std::string_view::npos,
        fmt::format("{} belongs to a rigid body of the shape {}, this is a {}: remove it", key, of, shape));
  }
}

}  // namespace

void read_shell(const toml::table& node, const std::string& file, const std::filesystem::path& folder, Scene& scene) {
  constexpr std::array<std::string_view, 12> keys{"name",      "mesh",           "unit",    "scale",
                                                  "thickness", "thickness_from", "young",   "poisson",
                                                  "density",   "membrane",       "bending", "rest"};
  const SceneTable table(node, file, "[[shell]]", keys);
  SceneShell shell;
  shell.places = table.places();
  shell.name = table.text("name");
  shell.mesh = folder / table.text("mesh");
  read_size(table, shell);
  shell.thickness_from = table.optional_text("thickness_from");
  if (shell.thickness_from && table.has("thickness")) {
    table.place("thickness_from").fail("thickness and thickness_from contradict each other: give one");
  }
  if (!shell.thickness_from) {
    shell.thickness = table.quantity("thickness", dimension::length, " (nor thickness_from)");
  }
  shell.material = read_material(table, false);
  table.choice<Membrane>("membrane", shell.membrane,
                         {{"cst", Membrane::cst}, {"opt", Membrane::opt}, {"adapt", Membrane::adapt}});
  table.choice<Bending>("bending", shell.bending,
                        {{"comas", Bending::comas},
                         {"comas-consistent", Bending::comas_consistent},
                         {"dkt", Bending::dkt},
                         {"dkt-comas", Bending::dkt_comas}});
  table.choice<Rest>("rest", shell.rest, {{"curved", Rest::curved}, {"flat", Rest::flat}});
  scene.shells.push_back(std::move(shell));
}

void read_solid(const toml::table& node, const std::string& file, const std::filesystem::path& folder, Scene& scene) {
  constexpr std::array<std::string_view, 10> keys{"name",  "mesh",  "fill",    "size",    "unit",
                                                  "scale", "young", "poisson", "density", "law"};
  const SceneTable table(node, file, "[[solid]]", keys);
  SceneSolid solid;
  solid.places = table.places();
  solid.name = table.text("name");
  if (table.has("fill")) {
    table.place("fill").require(!table.has("mesh"), "mesh and fill contradict each other: give one");
    solid.mesh = folder / table.text("fill");
    solid.fill_size = table.quantity("size", dimension::length, " (the edge of the tetrahedra that fill the surface)");
  } else {
    table.place("size").require(!table.has("size"), "size belongs to fill: remove it");
    solid.mesh = folder / table.text_of(table.required("mesh", " (nor fill)"), "mesh");
  }
  read_size(table, solid);
  solid.material = read_material(table, true);
  table.choice<SolidLaw>("law", solid.law,
                         {{"corotational", SolidLaw::corotational}, {"neo-hookean", SolidLaw::neo_hookean}});
  scene.solids.push_back(std::move(solid));
}

void read_rigid(const toml::table& node, const std::string& file, const std::filesystem::path& folder, bool dynamic,
                Scene& scene) {
  constexpr std::array<std::string_view, 14> keys{"name",   "shape", "centre", "radius", "from", "to",     "point",
                                                  "normal", "mesh",  "unit",   "scale",  "turn", "expand", "motion"};
  const SceneTable table(node, file, "[[rigid]]", keys);
  RigidReader read(table, dynamic, scene);
  SceneRigid rigid;
  rigid.places = table.places();
  rigid.name = table.text("name");
  Shape shape = Shape::mesh;
  if (table.has("mesh")) {
    table.place("shape").require(!table.has("shape"), "shape and mesh contradict each other: give one");
  } else {
    (void)table.required("shape", " (nor mesh)");
    table.choice<Shape>("shape", shape,
                        {{"sphere", Shape::sphere},
                         {"capsule", Shape::capsule},
                         {"cylinder", Shape::cylinder},
                         {"plane", Shape::plane}});
  }
  refuse_keys_of_others(table, shape == Shape::mesh ? "mesh" : table.text("shape"));
  switch (shape) {
    case Shape::sphere:
      rigid.shape = RigidSphere{read.points("centre"), read.radius()};
      break;
    case Shape::capsule:
      rigid.shape = RigidCapsule{read.points("from"), read.points("to"), read.radius()};
      break;
    case Shape::cylinder:
      rigid.shape = RigidCylinder{read.points("from"), read.points("to"), read.radius()};
      break;
    case Shape::plane:
      (void)table.required("normal");
      rigid.shape = RigidPlane{read.points("point"), read_direction(table, "normal")};
      break;
    case Shape::mesh: {
      SceneRigidMesh mesh;
      mesh.mesh = folder / table.text("mesh");
      read_size(table, mesh);
      if (table.has("turn")) {
        mesh.turn = read.turn();
      }
      if (table.has("expand")) {
        mesh.expansion = read.expansion();
      }
      rigid.shape = std::move(mesh);
      break;
    }
  }
  if (table.has("motion")) {
    rigid.motion = read.points("motion");
  }
  scene.rigids.push_back(std::move(rigid));
}

void read_attach(const toml::table& node, const std::string& file, Scene& scene) {
  constexpr std::array<std::string_view, 4> keys{"body", "where", "to", "side"};
  const SceneTable table(node, file, "[[attach]]", keys);
  SceneAttach attach;
  attach.places = table.places();
  attach.body = table.text("body");
  attach.where = read_where(table, true);
  attach.to = table.text("to");
  table.choice<Attachment::Side>(
      "side", attach.side,
      {{"inner", Attachment::Side::inner}, {"outer", Attachment::Side::outer}, {"middle", Attachment::Side::middle}});
  scene.attachments.push_back(std::move(attach));
}

void read_contact(const toml::table& node, const std::string& file, Scene& scene) {
  constexpr std::array<std::string_view, 6> keys{"name", "between", "friction", "resolution", "surface", "transfer"};
  constexpr std::string_view like = R"(["balloon", "plaque"])";
  const SceneTable table(node, file, "[[contact]]", keys);
  SceneContact contact;
  contact.places = table.places();
  const toml::array& between = table.array("between", like);
  if (between.size() != 2) {
    table.place("between").fail(fmt::format("between must be the names of two bodies, for example {}", like));
  }
  contact.between = {table.text_of(between[0], "between"), table.text_of(between[1], "between")};
  contact.name = table.optional_text("name").value_or(fmt::format("{}-{}", contact.between[0], contact.between[1]));
  if (table.has("friction")) {
    contact.friction = table.number("friction");
  }
  if (table.has("resolution")) {
    contact.resolution = table.part("resolution");
  }
  table.choice<bool>("surface", contact.curved, {{"curved", true}, {"facets", false}});
  table.choice<bool>("transfer", contact.consistent, {{"consistent", true}, {"paper", false}});
  if (!contact.consistent) {
    scene.notes.push_back(
        fmt::format("{}: transfer = \"paper\" loses moments: forces between \"{}\" and \"{}\" are not in balance",
                    table.place("transfer").text, contact.between[0], contact.between[1]));
  }
  scene.contacts.push_back(std::move(contact));
}

void note_idle_rigids(Scene& scene) {
  for (const SceneRigid& rigid : scene.rigids) {
    const bool touches = std::any_of(scene.contacts.begin(), scene.contacts.end(), [&](const SceneContact& contact) {
      return contact.between[0] == rigid.name || contact.between[1] == rigid.name;
    });
    if (!touches) {
      scene.notes.push_back(
          fmt::format("{}: no [[contact]] names \"{}\", so it does nothing", rigid.places.item.text, rigid.name));
    }
  }
}

}  // namespace tunica
