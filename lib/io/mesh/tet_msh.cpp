// Gmsh's format, versions 2 and 4.1, ASCII and binary (little-endian). Source: "MSH file format" in Gmsh's reference
// manual. Vertices have numbers ("tags") in any order and with gaps.
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/io/mesh/detail/tet_formats.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <map>
#include <optional>

namespace tunica::tets {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::size_t longest_title = 64;

struct MshElement {
  std::size_t corners;
  const char* flat;    // what is passed over; null for what fills a volume
  const char* volume;  // what is refused; null for a linear tetrahedron and what is flat
};

constexpr std::int64_t msh_tetrahedron = 4;

// By the numbers of the manual; those above 31 are of third order and more. None where the number is not known: then
// the size of a record is not either.
const MshElement* msh_element(std::int64_t type) {
  constexpr const char* line = "line";
  constexpr const char* triangle = "triangle";
  constexpr const char* square = "quadrilateral";
  constexpr const char* quadratic = "quadratic tetrahedra";
  constexpr const char* higher = "tetrahedra of third order or more";
  static const std::map<std::int64_t, MshElement> elements = {
      {1, {2, line, nullptr}},         {2, {3, triangle, nullptr}},      {3, {4, square, nullptr}},
      {4, {4, nullptr, nullptr}},      {5, {8, nullptr, "hexahedra"}},   {6, {6, nullptr, "prisms"}},
      {7, {5, nullptr, "pyramids"}},   {8, {3, line, nullptr}},          {9, {6, triangle, nullptr}},
      {10, {9, square, nullptr}},      {11, {10, nullptr, quadratic}},   {12, {27, nullptr, "hexahedra"}},
      {13, {18, nullptr, "prisms"}},   {14, {14, nullptr, "pyramids"}},  {15, {1, "point", nullptr}},
      {16, {8, square, nullptr}},      {17, {20, nullptr, "hexahedra"}}, {18, {15, nullptr, "prisms"}},
      {19, {13, nullptr, "pyramids"}}, {20, {9, triangle, nullptr}},     {21, {10, triangle, nullptr}},
      {22, {12, triangle, nullptr}},   {23, {15, triangle, nullptr}},    {24, {15, triangle, nullptr}},
      {25, {21, triangle, nullptr}},   {26, {4, line, nullptr}},         {27, {5, line, nullptr}},
      {28, {6, line, nullptr}},        {29, {20, nullptr, higher}},      {30, {35, nullptr, higher}},
      {31, {56, nullptr, higher}}};
  const auto found = elements.find(type);
  return found == elements.end() ? nullptr : &found->second;
}

// The numbers of a section, in text or in bytes.
class MshNumbers {
public:
  MshNumbers(std::string_view body, const std::string& name, std::size_t lines_before, bool binary,
             std::size_t size_bytes)
      : text_(body, name, lines_before), binary_(binary), size_bytes_(size_bytes) {}

  // Counts and tags of version 4 have the size that the file says.
  std::int64_t size(const char* what) {
    return binary_ ? (size_bytes_ == 8 ? static_cast<std::int64_t>(one<std::uint64_t>(what)) : one<std::uint32_t>(what))
                   : text_.integer(what);
  }
  std::int64_t integer(const char* what) { return binary_ ? one<std::int32_t>(what) : text_.integer(what); }
  double number(const char* what) { return binary_ ? one<double>(what) : text_.number(what); }

  // The count that version 2 writes as text in either encoding.
  std::size_t count_in_text(const char* what) { return text_.count(what); }

  std::size_t count(const char* what) {
    const std::int64_t value = size(what);
    if (value < 0) {
      text_.fail(fmt::format("{} is no count, as is expected within {}", value, what));
    }
    return narrow<std::size_t>(value);
  }

  // @param numbers  of a record at least, @param bytes  of it in binary
  void require_room(std::size_t records, std::size_t numbers, std::size_t bytes, const char* what) {
    text_.require_room(records, binary_ ? bytes : 2 * numbers, what);
  }

  void skip_integers(std::size_t count, const char* what) {
    for (std::size_t i = 0; i < count; ++i) {
      integer(what);
    }
  }

  [[noreturn]] void fail(const std::string& what) const { text_.fail(what); }

private:
  // In this machine's byte order, which is the file's.
  template <typename Number>
  Number one(const char* what) {
    Number value;
    std::memcpy(&value, text_.raw(sizeof value, what).data(), sizeof value);
    if (++taken_ % 65536 == 0) {
      check_interrupt();
    }
    return value;
  }

  NumberText text_;
  bool binary_;
  std::size_t size_bytes_;
  std::size_t taken_ = 0;
};

class MshReader {
public:
  MshReader(std::string_view bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  void read(Collector& into) {
    std::string_view body;
    while (const auto section = next_section(body)) {
      if (*section == "MeshFormat") {
        read_format(body);
      } else if (*section == "Nodes" || *section == "Elements") {
        if (!has_format_) {
          throw InputError(fmt::format("{}: ${} stands before $MeshFormat", name_, *section));
        }
        MshNumbers numbers(body, name_, lines_, binary_, size_bytes_);
        if (*section == "Nodes") {
          once(!tags_.empty(), "Nodes");
          read_nodes(numbers, into);
        } else {
          once(has_elements_, "Elements");
          has_elements_ = true;
          read_elements(numbers, into);
        }
      }
    }
    if (!has_format_ || !has_elements_ || tags_.empty()) {
      throw InputError(fmt::format("{}: is truncated, or no Gmsh file: it has no ${}", name_,
                                   !has_format_ ? "MeshFormat" : (tags_.empty() ? "Nodes" : "Elements")));
    }
    resolve(into);
  }

private:
  struct Tag {
    std::int64_t tag;
    Index vertex;
  };

  // The name of the next section, and what stands between its first and last line.
  std::optional<std::string_view> next_section(std::string_view& body) {
    const std::size_t begin = bytes_.find_first_not_of(" \t\r\n", at_);
    if (begin == std::string_view::npos) {
      return std::nullopt;
    }
    count_lines(begin);
    const std::size_t line_end = bytes_.find('\n', begin);
    std::string_view title = bytes_.substr(begin, std::min(line_end, bytes_.size()) - begin);
    title = title.substr(0, title.find_last_not_of(" \t\r") + 1);
    if (!title.starts_with('$') || title.size() > longest_title || line_end == std::string_view::npos) {
      throw InputError(fmt::format("{}: line {}: a section that begins with $ is expected", name_, lines_ + 1));
    }
    title.remove_prefix(1);
    const std::string last = fmt::format("$End{}", title);
    const std::size_t end = bytes_.find(last, line_end);
    if (end == std::string_view::npos) {
      throw InputError(fmt::format("{}: is truncated: {} is missing", name_, last));
    }
    body = bytes_.substr(line_end + 1, end - line_end - 1);
    count_lines(line_end + 1);
    at_ = end + last.size();
    return title;
  }

  // Keeps the number of lines before `to`, where reading goes on.
  void count_lines(std::size_t to) {
    lines_ += narrow<std::size_t>(std::count(bytes_.begin() + narrow<std::ptrdiff_t>(counted_),
                                             bytes_.begin() + narrow<std::ptrdiff_t>(to), '\n'));
    counted_ = to;
  }

  void once(bool there, const char* section) const {
    if (there) {
      throw InputError(fmt::format("{}: ${} is there twice", name_, section));
    }
  }

  void read_format(std::string_view body) {
    once(has_format_, "MeshFormat");
    has_format_ = true;
    NumberText text(body, name_, lines_);
    const double version = text.number("$MeshFormat");
    const std::int64_t binary = text.integer("$MeshFormat");
    const std::int64_t size = text.integer("$MeshFormat");
    four_ = version == 4.1;
    if (!four_ && !(version >= 2 && version < 3)) {
      text.fail(fmt::format("version {} is not understood: save the mesh as version 4.1 or 2.2", version));
    }
    if (binary != 0 && binary != 1) {
      text.fail("the kind of the file is 0 for ASCII or 1 for binary");
    }
    if (size != 8 && !(four_ && size == 4)) {
      text.fail(fmt::format("numbers of {} bytes are not understood", size));
    }
    binary_ = binary == 1;
    size_bytes_ = narrow<std::size_t>(size);
    if (binary_ && decoded_integers(text.raw(4, "$MeshFormat"), NumberType::int32, ByteOrder::little).front() != 1) {
      text.fail("binary files are understood in little-endian order only");
    }
  }

  void reserve_nodes(std::size_t count, Collector& into) {
    if (count > max_index) {
      throw InputError(fmt::format("{}: has {} vertices, at most {} are understood", name_, count, max_index));
    }
    tags_.reserve(count);
    into.vertices.reserve(count);
  }

  static Vec3 position(MshNumbers& numbers) {
    const double x = numbers.number("$Nodes");
    const double y = numbers.number("$Nodes");
    const double z = numbers.number("$Nodes");
    return {x, y, z};
  }

  void read_nodes(MshNumbers& numbers, Collector& into) {
    if (four_) {
      read_nodes_4(numbers, into);
    } else {
      read_nodes_2(numbers, into);
    }
  }

  void read_elements(MshNumbers& numbers, Collector& into) {
    if (four_) {
      read_elements_4(numbers, into);
    } else {
      read_elements_2(numbers, into);
    }
  }

  void read_nodes_2(MshNumbers& numbers, Collector& into) {
    const std::size_t count = numbers.count_in_text("$Nodes");
    numbers.require_room(count, 4, 28, "vertices");
    reserve_nodes(count, into);
    for (std::size_t i = 0; i < count; ++i) {
      tags_.push_back({numbers.integer("$Nodes"), narrow<Index>(i)});
      into.vertices.push_back(position(numbers));
    }
  }

  void read_nodes_4(MshNumbers& numbers, Collector& into) {
    const std::size_t blocks = numbers.count("$Nodes");
    const std::size_t promised = numbers.count("$Nodes");
    numbers.size("$Nodes");
    numbers.size("$Nodes");
    numbers.require_room(promised, 4, size_bytes_ + 24, "vertices");
    reserve_nodes(promised, into);
    for (std::size_t block = 0; block < blocks; ++block) {
      const std::int64_t dimension = numbers.integer("$Nodes");
      numbers.integer("$Nodes");
      const bool parametric = numbers.integer("$Nodes") != 0;
      const std::size_t count = numbers.count("$Nodes");
      if (dimension < 0 || dimension > 3) {
        numbers.fail(fmt::format("{} is no dimension", dimension));
      }
      if (count > promised - tags_.size()) {
        throw InputError(fmt::format("{}: has more vertices than the {} that $Nodes promises", name_, promised));
      }
      const std::size_t first = tags_.size();
      for (std::size_t i = 0; i < count; ++i) {
        tags_.push_back({numbers.size("$Nodes"), narrow<Index>(first + i)});
      }
      for (std::size_t i = 0; i < count; ++i) {
        into.vertices.push_back(position(numbers));
        for (std::int64_t k = 0; parametric && k < dimension; ++k) {
          numbers.number("$Nodes");
        }
      }
    }
    require_all(tags_.size(), promised, "vertices");
  }

  void require_all(std::size_t found, std::size_t promised, const char* what) const {
    if (found != promised) {
      throw InputError(fmt::format("{}: {} {} are promised, {} are there", name_, promised, what, found));
    }
  }

  const MshElement& element(std::int64_t type, const MshNumbers& numbers) const {
    const MshElement* element = msh_element(type);
    if (element == nullptr) {
      numbers.fail(fmt::format("elements of Gmsh's type {} are not understood", type));
    }
    return *element;
  }

  // One element's corners. Those of tetrahedra are kept until every vertex is known.
  void read_corners(std::int64_t type, const MshElement& element, MshNumbers& numbers, Collector& into) {
    if (element.volume != nullptr) {
      into.refuse(element.volume);
    }
    std::array<std::int64_t, 4> corners{};
    for (std::size_t k = 0; k < element.corners; ++k) {
      const std::int64_t tag = four_ ? numbers.size("$Elements") : numbers.integer("$Elements");
      corners[k % 4] = tag;
    }
    if (type == msh_tetrahedron) {
      corners_.push_back(corners);
    } else {
      into.skip(element.flat, 1);
    }
  }

  void read_elements_2(MshNumbers& numbers, Collector& into) {
    const std::size_t promised = numbers.count_in_text("$Elements");
    numbers.require_room(promised, 4, 8, "elements");  // a point: its number and its corner
    for (std::size_t read = 0; read < promised;) {
      if (!binary_) {
        numbers.integer("$Elements");
      }
      const std::int64_t type = numbers.integer("$Elements");
      const std::int64_t count = binary_ ? numbers.integer("$Elements") : 1;
      const std::int64_t tags = numbers.integer("$Elements");
      if (count < 1 || narrow<std::size_t>(count) > promised - read || tags < 0) {
        numbers.fail(fmt::format("a group of {} elements with {} tags each does not fit the {} elements promised",
                                 count, tags, promised));
      }
      const MshElement& kind = element(type, numbers);
      for (std::int64_t i = 0; i < count; ++i) {
        numbers.skip_integers(narrow<std::size_t>(tags) + (binary_ ? 1 : 0), "$Elements");
        read_corners(type, kind, numbers, into);
      }
      read += narrow<std::size_t>(count);
    }
  }

  void read_elements_4(MshNumbers& numbers, Collector& into) {
    const std::size_t blocks = numbers.count("$Elements");
    const std::size_t promised = numbers.count("$Elements");
    numbers.size("$Elements");
    numbers.size("$Elements");
    numbers.require_room(promised, 2, 2 * size_bytes_, "elements");
    std::size_t read = 0;
    for (std::size_t block = 0; block < blocks; ++block) {
      numbers.integer("$Elements");
      numbers.integer("$Elements");
      const std::int64_t type = numbers.integer("$Elements");
      const std::size_t count = numbers.count("$Elements");
      if (count > promised - read) {
        throw InputError(fmt::format("{}: has more elements than the {} that $Elements promises", name_, promised));
      }
      const MshElement& kind = element(type, numbers);
      for (std::size_t i = 0; i < count; ++i) {
        numbers.size("$Elements");
        read_corners(type, kind, numbers, into);
      }
      read += count;
    }
    require_all(read, promised, "elements");
  }

  // Tags to places in the list of vertices.
  void resolve(Collector& into) {
    const auto before = [](const Tag& l, const Tag& r) { return l.tag < r.tag; };
    if (!std::is_sorted(tags_.begin(), tags_.end(), before)) {
      std::sort(tags_.begin(), tags_.end(), before);
    }
    const auto twice =
        std::adjacent_find(tags_.begin(), tags_.end(), [](const Tag& l, const Tag& r) { return l.tag == r.tag; });
    if (twice != tags_.end()) {
      throw InputError(fmt::format("{}: vertex {} is there twice", name_, twice->tag));
    }
    into.tetrahedra.reserve(corners_.size());
    for (std::size_t t = 0; t < corners_.size(); ++t) {
      std::array<std::int64_t, 4> places{};
      for (std::size_t k = 0; k < 4; ++k) {
        const Tag wanted{corners_[t][k], 0};
        const auto found = std::lower_bound(tags_.begin(), tags_.end(), wanted, before);
        if (found == tags_.end() || found->tag != wanted.tag) {
          throw InputError(fmt::format("{}: tetrahedron {} names vertex {}, which is not there", name_, t, wanted.tag));
        }
        places[k] = found->vertex;
      }
      into.add(places, 0, into.vertices.size());
      if (t % 65536 == 0) {
        check_interrupt();
      }
    }
  }

  std::string_view bytes_;
  const std::string& name_;
  std::size_t at_ = 0;
  std::size_t lines_ = 0;
  std::size_t counted_ = 0;
  bool has_format_ = false;
  bool has_elements_ = false;
  bool four_ = false;
  bool binary_ = false;
  std::size_t size_bytes_ = 8;
  std::vector<Tag> tags_;
  std::vector<std::array<std::int64_t, 4>> corners_;
};

}  // namespace

void read_msh(std::string_view bytes, const std::string& name, Collector& into) { MshReader(bytes, name).read(into); }

}  // namespace tunica::tets
