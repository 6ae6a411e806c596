#include "tunica/io/result/page_file.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/json.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/io/file/output_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>

namespace tunica {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are copied as they stand in memory");

constexpr const char* format = "tunica page 1";
constexpr std::array kinds{"statics", "motion", "frequencies", "buckling", "path"};
constexpr std::size_t most_bytes = std::size_t{1} << 30;
constexpr std::size_t most_header = std::size_t{16} << 20;
constexpr std::size_t most_values = 1000;  // of a header: three per state, and some more
constexpr std::uint64_t most_points = max_index;

template <typename Number>
void put(std::string& bytes, Number number) {
  bytes.append(reinterpret_cast<const char*>(&number), sizeof number);
}

void put(std::string& bytes, const std::vector<double>& values) {
  for (const double value : values) {
    put(bytes, static_cast<float>(value));
  }
}

void put(std::string& bytes, const std::vector<Vec3>& vectors) {
  for (const Vec3& v : vectors) {
    for (const double component : v) {
      put(bytes, static_cast<float>(component));
    }
  }
}

void put(std::string& bytes, const TriangleMesh& mesh) {
  put(bytes, mesh.vertices);
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t corner : triangle) {
      put(bytes, corner);
    }
  }
}

/// Takes a page apart, its header first.
class Reader {
public:
  explicit Reader(const std::filesystem::path& path) : name_(path.string()), bytes_(read_file(path, most_bytes)) {
    at_ = std::min(bytes_.find('\n'), most_header);
    std::size_t values = 0;
    header_ = Json::parse(
        bytes_.begin(), bytes_.begin() + narrow<std::ptrdiff_t>(std::min(at_, bytes_.size())),
        [&](int depth, Json::parse_event_t, Json&) { return require(depth <= 3 && ++values < most_values); }, false);
    require(header_.is_object() && header_.value("format", Json()) == format);
    ++at_;
  }

  /// @return true. Errors: InputError.
  bool require(bool sound) const {
    if (!sound) {
      throw InputError(name_ + ": is damaged, or no page of this version: run the simulation again");
    }
    return true;
  }

  [[nodiscard]] Json at(const char* key) const { return header_.value(key, Json()); }

  [[nodiscard]] std::size_t count(const Json& value) const {
    require(value.is_number_unsigned() && value.get<std::uint64_t>() <= most_points);
    return value.get<std::size_t>();
  }

  [[nodiscard]] double number(const Json& value) const {
    require(value.is_number() && std::isfinite(value.get<double>()));
    return value.get<double>();
  }

  /// Whether exactly so many numbers follow the header.
  void require_numbers(std::uint64_t count) const { require(bytes_.size() - at_ == 4 * count); }

  template <typename Number>
  [[nodiscard]] Number next() {
    Number number{};
    std::memcpy(&number, bytes_.data() + at_, sizeof number);
    at_ += sizeof number;
    return number;
  }

  [[nodiscard]] std::vector<double> values(std::size_t count) {
    std::vector<double> values(count);
    std::ranges::generate(values, [&] { return next<float>(); });
    return values;
  }

  [[nodiscard]] std::vector<Vec3> vectors(std::size_t count) {
    constexpr double farthest = 1e12;  // mm
    std::vector<Vec3> vectors(count);
    for (Vec3& v : vectors) {
      for (double& component : v) {
        component = next<float>();
        require(std::abs(component) <= farthest);
      }
    }
    return vectors;
  }

  [[nodiscard]] TriangleMesh mesh(std::size_t points, std::size_t triangles) {
    TriangleMesh mesh{vectors(points), std::vector<std::array<Index, 3>>(triangles)};
    for (auto& triangle : mesh.triangles) {
      for (Index& corner : triangle) {
        corner = next<std::uint32_t>();
        require(corner < points);
      }
    }
    return mesh;
  }

private:
  std::string name_;
  std::string bytes_;
  std::size_t at_ = 0;
  Json header_;
};

}  // namespace

std::vector<DrawnResult::State> evenly_chosen(std::vector<DrawnResult::State> states, std::size_t most) {
  TUNICA_ASSERT(most >= 2);
  const std::size_t there = states.size();
  if (there <= most) {
    return states;
  }
  std::vector<DrawnResult::State> chosen;
  for (std::size_t i = 0; i < most; ++i) {
    chosen.push_back(std::move(states[i * (there - 1) / (most - 1)]));
  }
  return chosen;
}

std::filesystem::path page_path(const std::filesystem::path& result) {
  return std::filesystem::path(result).replace_extension(".page");
}

void write_page_file(const std::filesystem::path& path, const DrawnResult& drawn, bool overwrite) {
  Json states = Json::array();
  for (const DrawnResult::State& state : drawn.states) {
    states.push_back({state.number, state.time, state.load_factor});
  }
  const Json header{{"format", format},
                    {"made_by", drawn.made_by},
                    {"kind", kinds.at(static_cast<std::size_t>(drawn.kind))},
                    {"is_unloaded", drawn.is_unloaded},
                    {"shells", drawn.shells},
                    {"pieces", drawn.pieces},
                    {"points", drawn.reference.vertices.size()},
                    {"triangles", drawn.reference.triangles.size()},
                    {"solid_points", drawn.solids.vertices.size()},
                    {"solid_triangles", drawn.solids.triangles.size()},
                    {"states", states}};
  // A path in the command need not be UTF-8.
  std::string bytes = header.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
  put(bytes, drawn.reference);
  put(bytes, drawn.solids);
  for (const DrawnResult::State& state : drawn.states) {
    put(bytes, state.displacement);
    put(bytes, state.membrane);
    put(bytes, state.von_mises);
    put(bytes, state.of_solids);
  }
  write_file(path, bytes, overwrite);
}

DrawnResult read_page_file(const std::filesystem::path& path) {
  Reader reader(path);
  DrawnResult drawn;
  reader.require(reader.at("kind").is_string() && reader.at("is_unloaded").is_boolean() &&
                 reader.at("states").is_array() && !reader.at("states").empty());
  const auto* const kind = std::ranges::find(kinds, reader.at("kind").get<std::string>());
  reader.require(kind != kinds.end());
  drawn.kind = static_cast<DrawnResult::Kind>(kind - kinds.begin());
  drawn.is_unloaded = reader.at("is_unloaded").get<bool>();
  drawn.shells = reader.count(reader.at("shells"));
  drawn.pieces = reader.count(reader.at("pieces"));
  const std::size_t points = reader.count(reader.at("points"));
  const std::size_t triangles = reader.count(reader.at("triangles"));
  const std::size_t solid_points = reader.count(reader.at("solid_points"));
  const std::size_t solid_triangles = reader.count(reader.at("solid_triangles"));
  for (const Json& said : reader.at("states")) {
    reader.require(said.is_array() && said.size() == 3);
    drawn.states.push_back({reader.count(said[0]), reader.number(said[1]), reader.number(said[2]), {}, {}, {}, {}});
  }
  reader.require_numbers(3 * (points + triangles + solid_points + solid_triangles) +
                         drawn.states.size() * (5 * points + 3 * solid_points));
  reader.require(drawn.pieces >= 1 && drawn.pieces <= 64 && drawn.shells * drawn.pieces * drawn.pieces == triangles);
  if (triangles == 0) {
    throw InputError(path.string() + ": has no shells to draw");
  }
  drawn.reference = reader.mesh(points, triangles);
  drawn.solids = reader.mesh(solid_points, solid_triangles);
  for (DrawnResult::State& state : drawn.states) {
    state.displacement = reader.vectors(points);
    state.membrane = reader.values(points);
    state.von_mises = reader.values(points);
    state.of_solids = reader.vectors(solid_points);
  }
  return drawn;
}

}  // namespace tunica
