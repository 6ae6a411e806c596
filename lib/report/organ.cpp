#include "tunica/report/detail/organ.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/draw/picture.hpp"
#include "tunica/draw/thumbnail.hpp"
#include "tunica/io/file/encoding.hpp"
#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/report/detail/drawn_shells.hpp"
#include "tunica/report/detail/measures.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/distance/closest_point.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

namespace tunica::report {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t bytes_of_point = 8;  // shells: displacement and stresses; of solids without the stresses

struct Box {
  Vec3 lower = Vec3::Constant(infinity);
  Vec3 upper = Vec3::Constant(-infinity);

  void add(const std::vector<Vec3>& points) {
    for (const Vec3& p : points) {
      lower = lower.cwiseMin(p);
      upper = upper.cwiseMax(p);
    }
  }
  [[nodiscard]] double size() const { return std::max((upper - lower).maxCoeff(), 1e-9); }
};

// ------------------------------------------------------------------------------------------------------------- packing

// Differences to the number before, all low bytes first: what is next to each other is alike, which deflate likes.
void pack(std::string& bytes, const std::vector<std::uint32_t>& numbers, int width) {
  for (int plane = 0; plane < width; ++plane) {
    std::uint32_t before = 0;
    for (const std::uint32_t number : numbers) {
      bytes += static_cast<char>((number - before) >> (8 * plane) & 0xffU);
      before = number;
    }
  }
}

// Component by component, as 16 bits. @param level  of a component, 0 to 65535
template <typename Level>
void pack_vectors(std::string& bytes, const std::vector<Vec3>& vectors, const Level& level) {
  std::vector<std::uint32_t> numbers;
  for (Eigen::Index k = 0; k < 3; ++k) {
    for (const Vec3& vector : vectors) {
      numbers.push_back(truncated<std::uint32_t>(std::clamp(std::round(level(vector[k], k)), 0.0, 65535.0)));
    }
  }
  pack(bytes, numbers, 2);
}

template <std::size_t N>
void pack_indices(std::string& bytes, const std::vector<std::array<Index, N>>& tuples, std::size_t points) {
  std::vector<std::uint32_t> numbers;
  for (const auto& tuple : tuples) {
    numbers.insert(numbers.end(), tuple.begin(), tuple.end());
  }
  pack(bytes, numbers, points < 65536 ? 2 : 4);
}

void pack_levels(std::string& bytes, const std::vector<double>& values, double top) {
  for (const double value : values) {
    const double level = top > 0 && std::isfinite(value) ? 255 * value / top : 0;
    bytes += static_cast<char>(truncated<unsigned char>(std::clamp(std::round(level), 0.0, 255.0)));
  }
}

double largest(const std::vector<double>& values) {
  double most = 0;
  for (const double value : values) {
    most = std::isfinite(value) ? std::max(most, value) : most;
  }
  return most;
}

/// The largest values, which the colour bars end at.
struct Tops {
  std::optional<double> membrane, stress;  ///< MPa; none: there is no result
  double displacement = 0;                 ///< mm
  double component = 1e-12;                ///< mm, of any displacement
};

Tops tops_of(const DrawnShells& shells, bool loaded) {
  Tops tops;
  for (const DrawnResult::State& state : shells.states) {
    for (const Vec3& u : state.displacement) {
      tops.displacement = std::max(tops.displacement, u.norm());
      tops.component = std::max(tops.component, u.cwiseAbs().maxCoeff());
    }
    for (const Vec3& u : state.of_solids) {
      tops.displacement = std::max(tops.displacement, u.norm());
      tops.component = std::max(tops.component, u.cwiseAbs().maxCoeff());
    }
    if (loaded) {
      tops.membrane = std::max(tops.membrane.value_or(0), largest(state.membrane));
      tops.stress = std::max(tops.stress.value_or(0), largest(state.von_mises));
    }
  }
  return tops;
}

// The largest of 1, 2, 5, 10, … that moves nothing by more than a twentieth of the organ.
double magnification_for(double displacement, double diagonal) {
  double chosen = 1;
  for (const double factor : {2., 5., 10., 20., 50., 100.}) {
    chosen = displacement > 0 && factor * displacement <= 0.05 * diagonal ? factor : chosen;
  }
  return chosen;
}

Json list_of(const Vec3& v) { return Json::array({v.x(), v.y(), v.z()}); }

Json header_of(const DrawnShells& shells, const TriangleMesh& surface, const Tops& tops, double magnification) {
  Box box;
  box.add(shells.reference.vertices);
  box.add(surface.vertices);
  box.add(shells.solids.vertices);
  const auto [right, up, towards] = picture_axes(shells.reference.vertices);
  Vec3 lower = Vec3::Constant(infinity);
  Vec3 upper = -lower;
  for (const std::vector<Vec3>* points : {&shells.reference.vertices, &shells.solids.vertices}) {
    for (const Vec3& p : *points) {
      const Vec3 seen(right.dot(p), up.dot(p), towards.dot(p));
      lower = lower.cwiseMin(seen);
      upper = upper.cwiseMax(seen);
    }
  }
  const Vec3 middle = 0.5 * (lower + upper);
  const bool moves = tops.displacement > 0;
  const bool measured = !shells.distance.empty();
  Json header{
      {"shell", {{"points", shells.reference.vertices.size()}, {"triangles", shells.reference.triangles.size()}}},
      {"edges", shells.edges.size()},
      {"states", labels_of(shells)},
      {"origin", list_of(box.lower)},
      {"size", box.size()},
      {"displacement", tops.component},
      {"centre", list_of(middle.x() * right + middle.y() * up + middle.z() * towards)},
      {"up", list_of(up)},
      {"towards", list_of(towards)},
      {"extent", {upper.x() - lower.x(), upper.y() - lower.y()}},
      {"magnification", magnification},
      {"tops",
       {{"membrane", tops.membrane ? Json(*tops.membrane * 1e3) : Json()},
        {"stress", tops.stress ? Json(*tops.stress * 1e3) : Json()},
        {"displacement", moves ? Json(tops.displacement) : Json()},
        {"distance", measured ? Json(largest(shells.distance)) : Json()}}},
      {"names",
       {{"membrane", "Membrane stress (von Mises)"},
        {"stress", "Stress at the faces (von Mises)"},
        {"displacement", "Displacement"},
        {"distance", "Distance to the segmented surface"}}},
      {"units", {{"membrane", "kPa"}, {"stress", "kPa"}, {"displacement", "mm"}, {"distance", "mm"}}},
      {"surface", nullptr},
      {"solids", nullptr},
      {"rest", shells.is_unloaded ? "without load" : "as imaged"},
      {"palette", surface_colours()},
  };
  if (!surface.triangles.empty()) {
    header["surface"] = {{"points", surface.vertices.size()}, {"triangles", surface.triangles.size()}};
  }
  if (!shells.solids.triangles.empty()) {
    header["solids"] = {{"points", shells.solids.vertices.size()}, {"triangles", shells.solids.triangles.size()}};
  }
  return header;
}

// The header and the arrays, as web/src/data.js reads them.
std::string packed(const DrawnShells& shells, const TriangleMesh& surface, const Tops& tops, const Json& header) {
  const std::string text = header.dump();
  std::string bytes;
  for (unsigned shift = 0; shift < 32; shift += 8) {
    bytes += static_cast<char>(text.size() >> shift & 0xffU);
  }
  bytes += text;
  const auto& origin = header.at("origin");
  const double size = header.at("size").get<double>();
  const auto place = [&](double value, Eigen::Index k) {
    return 65535 * (value - origin.at(narrow<std::size_t>(k)).get<double>()) / size;
  };
  const std::size_t points = shells.reference.vertices.size();
  pack_vectors(bytes, shells.reference.vertices, place);
  pack_indices(bytes, shells.reference.triangles, points);
  pack_indices(bytes, shells.edges, points);
  if (!shells.distance.empty()) {
    pack_levels(bytes, shells.distance, largest(shells.distance));
  }
  const auto shift = [&](double value, Eigen::Index) { return 32768 + 32767 * value / tops.component; };
  for (const DrawnResult::State& state : shells.states) {
    pack_vectors(bytes, state.displacement, shift);
    pack_levels(bytes, state.membrane, tops.membrane.value_or(0));
    pack_levels(bytes, state.von_mises, tops.stress.value_or(0));
  }
  if (!surface.triangles.empty()) {
    pack_vectors(bytes, surface.vertices, place);
    pack_indices(bytes, surface.triangles, surface.vertices.size());
  }
  if (!shells.solids.triangles.empty()) {
    pack_vectors(bytes, shells.solids.vertices, place);
    pack_indices(bytes, shells.solids.triangles, shells.solids.vertices.size());
    for (const DrawnResult::State& state : shells.states) {
      pack_vectors(bytes, state.of_solids, shift);
    }
  }
  return base64(deflated(bytes));
}

// ------------------------------------------------------------------------------------------------------------- reading

bool is_there(const fs::path& path) {
  std::error_code error;
  return fs::exists(path, error);
}

// What a reader gives, or none, with the reason in `missing`.
template <typename Read>
auto attempt(CaseReport& one, const char* file, const Read& read) -> std::optional<decltype(read(fs::path()))> {
  const fs::path path = one.source.folder / file;
  if (one.source.folder.empty() || !is_there(path)) {
    return std::nullopt;
  }
  try {
    return read(path);
  } catch (const InputError& error) {
    one.missing.push_back(one.redacted(error.what()));
    return std::nullopt;
  }
}

// Curved shells without a load.
DrawnResult unloaded(const fs::path& path) {
  constexpr int pieces = 3;
  const ShellMesh shell = shell_of(read_mesh(path), path);
  require_fit(shell, path.string());
  DrawnResult drawn;
  drawn.reference = tessellate_uniformly(shell, pieces).mesh;
  drawn.shells = shell.triangles.size();
  drawn.pieces = pieces;
  const std::size_t points = drawn.reference.vertices.size();
  DrawnResult::State& rest = drawn.states.emplace_back();
  rest.displacement.assign(points, Vec3::Zero());
  rest.membrane.assign(points, 0);
  rest.von_mises.assign(points, 0);
  return drawn;
}

// Of a result without the page's data, as older tools left it.
std::string untold_result(const CaseReport& one) {
  Json arguments = arguments_of(one.source, "simulate");
  arguments["--force"] = true;
  return one.redacted("result.page is missing, as in results of older versions: the loaded organ is not drawn; " +
                      command_of("tunica-simulate", arguments) + " draws it");
}

void draw_shells(CaseReport& one, const Room& room, DrawnShells shells, const std::optional<TriangleMesh>& surface,
                 bool loaded) {
  // Without its load the organ is not where it was imaged.
  if (surface && !shells.is_unloaded) {
    const ClosestPoint tree(*surface);
    for (const Vec3& p : shells.reference.vertices) {
      shells.distance.push_back(std::sqrt(tree.closest(p).squared_distance));
    }
  }
  const Tops tops = tops_of(shells, loaded);
  Box box;
  box.add(shells.reference.vertices);
  one.magnification = magnification_for(tops.displacement, (box.upper - box.lower).norm());
  one.picture_top = tops.membrane.value_or(0);
  TriangleMesh seen = shells.reference;
  for (std::size_t v = 0; v < seen.vertices.size(); ++v) {
    seen.vertices[v] += one.magnification * shells.states.back().displacement[v];
  }
  // As it stands in 3-D, which is decided by the shape without load.
  one.seen = {std::move(seen), {}, picture_axes(shells.reference.vertices)};
  if (loaded) {
    one.seen.stress = shells.states.back().membrane;
  }
  TriangleMesh coarse;
  if (surface) {
    try {
      coarse = thinned(*surface, room.triangles / 2);
    } catch (const InputError& error) {
      one.missing.push_back(one.redacted(error.what()));
    }
  }
  one.organ = packed(shells, coarse, tops, header_of(shells, coarse, tops, one.magnification));
}

}  // namespace

Room room_for(std::size_t cases) {
  const std::size_t count = std::max<std::size_t>(cases, 1);
  Room room;
  room.triangles = std::clamp<std::size_t>(600'000 / count, 1'000, most_page_triangles);
  room.states = std::clamp<std::size_t>(4000 / count, 2, most_page_states);
  room.bytes = most_page_bytes / count;
  room.picture_longest = count == 1 ? 1080 : count <= 12 ? 720 : count <= 60 ? 400 : 160;
  room.slice = count == 1 ? 220 : count <= 12 ? 150 : count <= 60 ? 100 : 60;
  return room;
}

void draw_organ(CaseReport& one, const Room& room) {
  const auto surface = attempt(one, "surface.ply", [](const fs::path& path) { return read_mesh(path).mesh; });
  const bool simulated = one.source.at("simulate", "ok") == true;
  auto result = simulated ? attempt(one, "result.page", read_page_file) : std::nullopt;
  if (simulated && !is_there(one.source.folder / "result.page")) {
    one.missing.push_back(untold_result(one));
  }
  const bool loaded = result.has_value();
  if (!loaded) {
    result = attempt(one, "shell.ply", unloaded);
  }
  if (result) {
    try {
      DrawnShells shells = thinned(std::move(*result), room.triangles);
      const std::size_t of_state = bytes_of_point * (shells.reference.vertices.size() + shells.solids.vertices.size());
      const std::size_t states =
          std::clamp<std::size_t>(room.bytes / std::max<std::size_t>(of_state, 1), 2, room.states);
      shells.states = evenly_chosen(std::move(shells.states), states);
      draw_shells(one, room, std::move(shells), surface, loaded);
    } catch (const InputError& error) {
      one.missing.push_back(one.redacted(error.what()));
    }
  } else if (surface && !surface->triangles.empty()) {
    one.picture = thumbnail(*surface, {}, {room.picture_longest, 0, picture_axes(surface->vertices)});
  }
}

void take_pictures(std::vector<CaseReport>& cases, const Room& room) {
  std::map<std::string, double> tops;
  for (const CaseReport& one : cases) {
    const auto stress = measure("membrane_p99_kpa").value(one.source);
    if (cases.size() > 1 && !one.seen.stress.empty() && stress) {
      double& top = tops.try_emplace(one.organ_kind, 0).first->second;
      top = std::max(top, *stress * 1e-3);
    }
  }
  for (CaseReport& one : cases) {
    check_interrupt();
    if (one.seen.mesh.triangles.empty()) {
      continue;
    }
    const auto shared = tops.find(one.organ_kind);
    if (shared != tops.end() && shared->second > 0 && !one.seen.stress.empty()) {
      one.picture_top = shared->second;
    }
    one.picture = thumbnail(one.seen.mesh, one.seen.stress, {room.picture_longest, one.picture_top, one.seen.axes});
    one.seen = {};
  }
}

}  // namespace tunica::report
