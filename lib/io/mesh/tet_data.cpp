// What the readers of tetrahedra share: numbers in text and bytes, the elements found, the cells of VTK.
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/io/mesh/detail/tet_formats.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <concepts>

namespace tunica::tets {
namespace {

static_assert(std::endian::native == std::endian::little);

template <typename To, typename From>
void decode_as(std::string_view bytes, ByteOrder order, std::vector<To>& values) {
  for (std::size_t at = 0; at + sizeof(From) <= bytes.size(); at += sizeof(From)) {
    std::array<char, sizeof(From)> word;
    std::memcpy(word.data(), bytes.data() + at, sizeof(From));
    if (order == ByteOrder::big) {
      std::reverse(word.begin(), word.end());
    }
    values.push_back(static_cast<To>(std::bit_cast<From>(word)));
    if (at % (std::size_t{1} << 20) == 0) {
      check_interrupt();
    }
  }
}

template <typename To>
std::vector<To> decoded(std::string_view bytes, NumberType type, ByteOrder order) {
  std::vector<To> values;
  values.reserve(bytes.size() / size_of(type));
  switch (type) {
    case NumberType::int8:
      decode_as<To, std::int8_t>(bytes, order, values);
      break;
    case NumberType::uint8:
      decode_as<To, std::uint8_t>(bytes, order, values);
      break;
    case NumberType::int16:
      decode_as<To, std::int16_t>(bytes, order, values);
      break;
    case NumberType::uint16:
      decode_as<To, std::uint16_t>(bytes, order, values);
      break;
    case NumberType::int32:
      decode_as<To, std::int32_t>(bytes, order, values);
      break;
    case NumberType::uint32:
      decode_as<To, std::uint32_t>(bytes, order, values);
      break;
    case NumberType::int64:
      decode_as<To, std::int64_t>(bytes, order, values);
      break;
    case NumberType::uint64:
      decode_as<To, std::uint64_t>(bytes, order, values);
      break;
    case NumberType::float32:
    case NumberType::float64:
      if constexpr (std::floating_point<To>) {
        if (type == NumberType::float32) {
          decode_as<To, float>(bytes, order, values);
        } else {
          decode_as<To, double>(bytes, order, values);
        }
      } else {
        TUNICA_ASSERT(is_whole(type));
      }
      break;
  }
  return values;
}

// Cells of VTK that fill no volume, by their number in vtkCellType.h, so that none is missed when they are passed over.
std::string flat_cell(std::int64_t type) {
  switch (type) {
    case 0:
      return "empty cell";
    case 1:
    case 2:
      return "point";
    case 3:
    case 4:
    case 21:
    case 35:
      return "line";
    case 5:
    case 22:
    case 34:
      return "triangle";
    case 6:
      return "strip of triangles";
    case 7:
    case 36:
      return "polygon";
    case 8:
    case 9:
    case 23:
    case 28:
    case 30:
      return "quadrilateral";
    default:
      return {};
  }
}

constexpr std::int64_t vtk_tetrahedron = 10;

}  // namespace

void Collector::add(std::span<const std::int64_t> corners, std::size_t first, std::size_t count) {
  TUNICA_ASSERT(corners.size() == 4);
  std::array<Index, 4> tet;
  for (std::size_t k = 0; k < 4; ++k) {
    if (corners[k] < 0 || !std::in_range<std::size_t>(corners[k]) || narrow<std::size_t>(corners[k]) >= count) {
      throw InputError(fmt::format("{}: tetrahedron {} names vertex {}, but there are only {}", name_,
                                   tetrahedra.size(), corners[k], count));
    }
    tet[k] = narrow<Index>(first + narrow<std::size_t>(corners[k]));
  }
  if (tetrahedra.size() >= max_index) {
    throw InputError(fmt::format("{}: has more than {} tetrahedra", name_, max_index));
  }
  tetrahedra.push_back(tet);
}

void Collector::refuse(const std::string& kind) const {
  throw InputError(
      fmt::format("{}: has {}, only linear tetrahedra are understood: save the mesh with first-order tetrahedra only",
                  name_, kind));
}

void Collector::remark(const std::string& what) { remarks_.push_back(fmt::format("{}: {}", name_, what)); }

std::vector<std::string> Collector::notes() const {
  std::vector<std::string> counts;
  std::size_t sum = 0;
  for (const auto& [noun, count] : skipped_) {
    sum += count;
    const std::string several = noun == "strip of triangles" ? "strips of triangles" : noun + "s";
    counts.push_back(count == 1 ? "one " + noun : fmt::format("{} {}", count, several));
  }
  std::vector<std::string> notes;
  if (sum > 0) {
    notes.push_back(fmt::format("{}: {} {} passed over: only tetrahedra are read", name_, fmt::join(counts, ", "),
                                sum == 1 ? "is" : "are"));
  }
  notes.insert(notes.end(), remarks_.begin(), remarks_.end());
  return notes;
}

std::vector<double> decoded_numbers(std::string_view bytes, NumberType type, ByteOrder order) {
  return decoded<double>(bytes, type, order);
}

std::vector<std::int64_t> decoded_integers(std::string_view bytes, NumberType type, ByteOrder order) {
  return decoded<std::int64_t>(bytes, type, order);
}

void NumberText::fail(const std::string& what) const {
  throw InputError(fmt::format("{}: line {}: {}", name_, scanner_.line(), what));
}

void NumberText::go_to_token(const char* what) {
  if (scanner_.at_line_end()) {
    if (!scanner_.next_line()) {
      throw InputError(fmt::format("{}: is truncated: it ends within {}", name_, what));
    }
    if (scanner_.line() % 65536 == 0) {
      check_interrupt();
    }
  }
}

double NumberText::number(const char* what) {
  go_to_token(what);
  const auto value = scanner_.number();
  if (!value) {
    fail(fmt::format("a number is expected within {}", what));
  }
  return *value;
}

std::int64_t NumberText::integer(const char* what) {
  go_to_token(what);
  const auto value = scanner_.integer();
  if (!value) {
    fail(fmt::format("a whole number is expected within {}", what));
  }
  return *value;
}

std::string_view NumberText::word(const char* what) {
  go_to_token(what);
  return scanner_.token();
}

std::size_t NumberText::count(const char* what) {
  const std::int64_t value = integer(what);
  if (value < 0) {
    fail(fmt::format("{} is no count, as is expected within {}", value, what));
  }
  return narrow<std::size_t>(value);
}

std::string_view NumberText::raw(std::size_t bytes, const char* what) {
  const std::string_view left = following();
  if (bytes > left.size()) {
    throw InputError(fmt::format("{}: is truncated: {} bytes of {} are missing", name_, bytes - left.size(), what));
  }
  text_ = left.substr(bytes);
  scanner_ = TextScanner(text_, scanner_.line());
  return left.substr(0, bytes);
}

void NumberText::skip_paragraph() {
  const std::string_view left = following();
  // The line may be the first one, and its end that of DOS.
  std::size_t end = 0;
  while (end < left.size()) {
    const std::size_t stop = std::min(left.find('\n', end), left.size());
    const std::string_view line = left.substr(end, stop - end);
    end = std::min(stop + 1, left.size());
    if (line.empty() || line == "\r") {
      break;
    }
  }
  raw(end, "a paragraph");
}

void NumberText::require_room(std::size_t count, std::size_t each, const char* what) {
  const std::size_t left = scanner_.rest().size() + scanner_.remaining() + 1;  // the last line may lack its end
  if (count > left / each) {
    throw InputError(fmt::format("{}: is truncated: {} {} are promised, the {} bytes that are left cannot hold them",
                                 name_, count, what, left));
  }
}

void add_cells(const VtkCells& cells, std::size_t first, std::size_t vertices, const std::string& name,
               Collector& into) {
  TUNICA_ASSERT(cells.types.size() == cells.ends.size());
  std::int64_t begin = 0;
  for (std::size_t c = 0; c < cells.types.size(); ++c) {
    const std::int64_t end = cells.ends[c];
    if (end < begin || !std::in_range<std::size_t>(end) || narrow<std::size_t>(end) > cells.connectivity.size()) {
      throw InputError(fmt::format("{}: the corners of cell {} would be those from {} to {} of {}", name, c, begin, end,
                                   cells.connectivity.size()));
    }
    const std::int64_t type = cells.types[c];
    if (type == vtk_tetrahedron) {
      if (end - begin != 4) {
        throw InputError(fmt::format("{}: cell {} is a tetrahedron with {} corners", name, c, end - begin));
      }
      into.add(std::span(cells.connectivity).subspan(narrow<std::size_t>(begin), 4), first, vertices);
    } else if (const std::string noun = flat_cell(type); !noun.empty()) {
      into.skip(noun, 1);
    } else {
      constexpr std::int64_t quadratic = 24;
      into.refuse(type == quadratic ? "quadratic tetrahedra"
                                    : fmt::format("cells of VTK's type {}, which is no flat one", type));
    }
    begin = end;
  }
}

void add_points(std::span<const double> coordinates, const std::string& name, Collector& into) {
  if (coordinates.size() / 3 > max_index - std::min(max_index, into.vertices.size())) {
    throw InputError(fmt::format("{}: has more than {} vertices", name, max_index));
  }
  into.vertices.reserve(into.vertices.size() + coordinates.size() / 3);
  for (std::size_t i = 0; i + 2 < coordinates.size(); i += 3) {
    into.vertices.emplace_back(coordinates[i], coordinates[i + 1], coordinates[i + 2]);
  }
}

}  // namespace tunica::tets
