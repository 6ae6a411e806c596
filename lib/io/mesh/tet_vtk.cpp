// VTK's legacy format: an unstructured grid, ASCII or binary (big-endian), its cells as counts and corners among each
// other (to version 4) or as offsets and connectivity (from 5 on).
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/io/mesh/detail/tet_formats.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

namespace tunica::tets {
namespace {

std::string vtk_lower(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](char c) { return static_cast<char>(c >= 'A' && c <= 'Z' ? c + 32 : c); });
  return lower;
}

std::optional<NumberType> vtk_scalar(std::string_view word) {
  // vtkIdType is written as int; long is that of the 64-bit Unix that VTK's files mostly come from.
  static const std::map<std::string, NumberType, std::less<>> scalars = {{"char", NumberType::int8},
                                                                         {"signed_char", NumberType::int8},
                                                                         {"unsigned_char", NumberType::uint8},
                                                                         {"short", NumberType::int16},
                                                                         {"unsigned_short", NumberType::uint16},
                                                                         {"int", NumberType::int32},
                                                                         {"unsigned_int", NumberType::uint32},
                                                                         {"long", NumberType::int64},
                                                                         {"unsigned_long", NumberType::uint64},
                                                                         {"vtktypeint64", NumberType::int64},
                                                                         {"vtktypeuint64", NumberType::uint64},
                                                                         {"vtktypeint32", NumberType::int32},
                                                                         {"vtkidtype", NumberType::int32},
                                                                         {"float", NumberType::float32},
                                                                         {"double", NumberType::float64}};
  const auto found = scalars.find(vtk_lower(word));
  return found == scalars.end() ? std::nullopt : std::optional(found->second);
}

class VtkReader {
public:
  VtkReader(std::string_view bytes, const std::string& name) : text_(body_of(bytes, name), name, 3), name_(name) {}

  void read(Collector& into) {
    bool data = false;
    while (!data && text_.next_line()) {
      data = read_part(vtk_lower(text_.token()));
    }
    if (!points_ || !ends_ || !types_) {
      throw InputError(fmt::format("{}: is truncated, or no unstructured grid: it has no {}", name_,
                                   !points_ ? "POINTS" : (!ends_ ? "CELLS" : "CELL_TYPES")));
    }
    if (ends_->size() != types_->size()) {
      throw InputError(fmt::format("{}: has {} cells, but the types of {}", name_, ends_->size(), types_->size()));
    }
    add_points(*points_, name_, into);
    add_cells({std::move(*types_), std::move(*ends_), std::move(connectivity_)}, 0, into.vertices.size(), name_, into);
  }

private:
  // The title may be empty: the first three lines are taken as they are.
  std::string_view body_of(std::string_view bytes, const std::string& name) {
    std::array<std::string_view, 3> head;
    for (std::string_view& line : head) {
      const std::size_t end = bytes.find('\n');
      if (end == std::string_view::npos) {
        throw InputError(fmt::format("{}: is truncated: it ends within the header", name));
      }
      line = bytes.substr(0, end);
      bytes.remove_prefix(end + 1);
    }
    if (!head[0].starts_with("# vtk DataFile Version")) {
      throw InputError(fmt::format("{}: is no VTK file: it does not begin with \"# vtk DataFile Version\"", name));
    }
    TextScanner encoding(head[2]);
    const std::string word = encoding.next_line() ? vtk_lower(encoding.token()) : "";
    if (word != "ascii" && word != "binary") {
      throw InputError(fmt::format("{}: line 3: ASCII or BINARY is expected", name));
    }
    binary_ = word == "binary";
    return bytes;
  }

  // @return whether the data on the mesh begin, of which nothing is read
  bool read_part(const std::string& keyword) {
    if (keyword == "dataset") {
      if (const std::string kind = vtk_lower(text_.token()); kind != "unstructured_grid") {
        text_.fail("tetrahedra are read from DATASET UNSTRUCTURED_GRID only");
      }
    } else if (keyword == "points") {
      once(points_.has_value(), "POINTS");
      const std::size_t count = text_.count("POINTS");
      points_ = numbers(triple(count), scalar("POINTS"), "coordinates");
    } else if (keyword == "cells") {
      once(ends_.has_value(), "CELLS");
      read_cells();
    } else if (keyword == "cell_types") {
      once(types_.has_value(), "CELL_TYPES");
      types_ = integers(text_.count("CELL_TYPES"), NumberType::int32, "types of cells");
    } else if (keyword == "field") {
      skip_field();
    } else if (keyword == "metadata") {
      text_.skip_paragraph();
    } else if (keyword == "cell_data" || keyword == "point_data") {
      return true;
    } else {
      text_.fail("no part of an unstructured grid begins here: the counts before may be wrong");
    }
    return false;
  }

  void once(bool there, const char* what) const {
    if (there) {
      text_.fail(fmt::format("{} are there twice", what));
    }
  }

  std::size_t triple(std::size_t count) const {
    if (count > max_index) {
      text_.fail(fmt::format("{} points are more than are understood", count));
    }
    return 3 * count;
  }

  NumberType scalar(const char* what) {
    const auto type = vtk_scalar(text_.word(what));
    if (!type) {
      text_.fail(fmt::format("{}: a type of numbers is expected: float, double, int, ...", what));
    }
    return *type;
  }

  void end_of_numbers(const char* what) {
    if (!text_.at_line_end()) {
      text_.fail(fmt::format("more {} stand here than were promised", what));
    }
  }

  // Bytes of `count` values that follow the line.
  std::string_view block(std::size_t count, NumberType type, const char* what) {
    end_of_numbers("words");
    text_.require_room(count, size_of(type), what);
    return text_.raw(count * size_of(type), what);
  }

  std::vector<double> numbers(std::size_t count, NumberType type, const char* what) {
    if (binary_) {
      return decoded_numbers(block(count, type, what), type, ByteOrder::big);
    }
    text_.require_room(count, 2, what);
    std::vector<double> values(count);
    std::generate(values.begin(), values.end(), [&] { return text_.number(what); });
    end_of_numbers(what);
    return values;
  }

  std::vector<std::int64_t> integers(std::size_t count, NumberType type, const char* what) {
    if (!is_whole(type)) {
      text_.fail(fmt::format("{} are whole numbers", what));
    }
    if (binary_) {
      return decoded_integers(block(count, type, what), type, ByteOrder::big);
    }
    text_.require_room(count, 2, what);
    std::vector<std::int64_t> values(count);
    std::generate(values.begin(), values.end(), [&] { return text_.integer(what); });
    end_of_numbers(what);
    return values;
  }

  void read_cells() {
    const std::size_t first = text_.count("CELLS");
    const std::size_t second = text_.count("CELLS");
    // Decided by the word, not by the version: writers differ in what they call theirs.
    if (vtk_lower(text_.following().substr(0, 7)) == "offsets") {
      read_offsets(first, second);
      return;
    }
    const std::vector<std::int64_t> values = integers(second, NumberType::int32, "corners of cells");
    ends_.emplace();
    for (std::size_t at = 0; at < values.size();) {
      const std::int64_t corners = values[at++];
      if (corners < 0 || narrow<std::size_t>(corners) > values.size() - at) {
        throw InputError(fmt::format("{}: cell {} has {} corners, but only {} numbers are left of CELLS", name_,
                                     ends_->size(), corners, values.size() - at));
      }
      const auto begin = values.begin() + narrow<std::ptrdiff_t>(at);
      connectivity_.insert(connectivity_.end(), begin, begin + narrow<std::ptrdiff_t>(corners));
      at += narrow<std::size_t>(corners);
      ends_->push_back(narrow<std::int64_t>(connectivity_.size()));
    }
    if (ends_->size() != first) {
      throw InputError(fmt::format("{}: {} cells are promised, CELLS holds {}", name_, first, ends_->size()));
    }
  }

  void read_offsets(std::size_t offsets, std::size_t corners) {
    text_.next_line();
    text_.token();
    ends_ = integers(offsets, scalar("OFFSETS"), "offsets of cells");
    if (!text_.next_line() || vtk_lower(text_.token()) != "connectivity") {
      text_.fail("CONNECTIVITY is expected");
    }
    connectivity_ = integers(corners, scalar("CONNECTIVITY"), "corners of cells");
    if (!ends_->empty()) {
      if (ends_->front() != 0) {
        throw InputError(fmt::format("{}: the first of the OFFSETS is {}, not 0", name_, ends_->front()));
      }
      ends_->erase(ends_->begin());
    }
  }

  void skip_field() {
    text_.token();
    const std::size_t arrays = text_.count("FIELD");
    for (std::size_t i = 0; i < arrays; ++i) {
      if (!text_.next_line()) {
        throw InputError(fmt::format("{}: is truncated: it ends within FIELD", name_));
      }
      if (vtk_lower(text_.token()) == "metadata") {
        text_.skip_paragraph();
        --i;
        continue;
      }
      const std::size_t components = text_.count("FIELD");
      const std::size_t tuples = text_.count("FIELD");
      text_.require_room(tuples, std::max<std::size_t>(components, 1), "values of FIELD");
      numbers(components * tuples, scalar("FIELD"), "values of FIELD");
    }
  }

  bool binary_ = false;  // before text_, whose construction finds it
  NumberText text_;
  const std::string& name_;
  std::optional<std::vector<double>> points_;
  std::optional<std::vector<std::int64_t>> ends_, types_;
  std::vector<std::int64_t> connectivity_;
};

}  // namespace

void read_vtk(std::string_view bytes, const std::string& name, Collector& into) { VtkReader(bytes, name).read(into); }

}  // namespace tunica::tets
