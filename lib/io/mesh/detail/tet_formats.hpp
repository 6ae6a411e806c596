#pragma once

#include "tunica/core/types.hpp"
#include "tunica/io/file/text_scanner.hpp"

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

/// Inside lib/io: one reader per format of tetrahedra, from the file's bytes to positions in the file's own unit, and
/// what they share. `name` is the file's name for messages. Counts are checked against the bytes there are before
/// anything is allocated.
namespace tunica::tets {

/// Gathers what the readers find. Elements that are no linear tetrahedra are counted, or refused where the volume they
/// fill would be missing.
class Collector {
public:
  explicit Collector(std::string name) : name_(std::move(name)) {}

  std::vector<Vec3> vertices;
  std::vector<std::array<Index, 4>> tetrahedra;

  /// Errors: InputError when a corner is not below `vertices`; `first` is then added to each.
  void add(std::span<const std::int64_t> corners, std::size_t first, std::size_t count);

  /// @param noun  "triangle", "line", ...: what is passed over
  void skip(const std::string& noun, std::size_t count) { skipped_[noun] += count; }

  /// Errors: InputError, always: it says why elements of that kind, e.g. "quadratic tetrahedra", are none to read.
  [[noreturn]] void refuse(const std::string& kind) const;

  /// What else a user should know: "has ...".
  void remark(const std::string& what);

  /// What was passed over, and the remarks.
  [[nodiscard]] std::vector<std::string> notes() const;

private:
  std::string name_;
  std::map<std::string, std::size_t> skipped_;
  std::vector<std::string> remarks_;
};

/// The elements of a file, into an empty collector. Errors: InputError.
void read_msh(std::string_view bytes, const std::string& name, Collector& into);
void read_vtk(std::string_view bytes, const std::string& name, Collector& into);
void read_vtu(std::string_view bytes, const std::string& name, Collector& into);

enum class NumberType { int8, uint8, int16, uint16, int32, uint32, int64, uint64, float32, float64 };

/// Bytes of one value.
constexpr std::size_t size_of(NumberType scalar) {
  constexpr std::size_t sizes[] = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
  return sizes[static_cast<std::size_t>(scalar)];
}

/// Whether it is a type of whole numbers.
constexpr bool is_whole(NumberType scalar) { return scalar < NumberType::float32; }

enum class ByteOrder { little, big };

/// The values that stand one after the other in `bytes`, a multiple of their size. A whole number beyond 2^63 - 1 comes
/// out negative: it is no index and no count anyway.
std::vector<double> decoded_numbers(std::string_view bytes, NumberType type, ByteOrder order);
std::vector<std::int64_t> decoded_integers(std::string_view bytes, NumberType type, ByteOrder order);

/// A text of numbers that flow over the ends of lines, with blocks of bytes among them.
class NumberText {
public:
  NumberText(std::string_view text, const std::string& name, std::size_t lines_before = 0)
      : text_(text), name_(name), scanner_(text, lines_before) {}

  bool next_line() { return scanner_.next_line(); }
  std::string_view token() { return scanner_.token(); }
  [[nodiscard]] bool at_line_end() { return scanner_.at_line_end(); }

  /// The next token, on whichever line. Errors: InputError at the end of the text.
  double number(const char* what);
  std::int64_t integer(const char* what);
  std::string_view word(const char* what);

  /// A whole number that is not negative.
  std::size_t count(const char* what);

  /// What follows the current line, as it is. Errors: InputError when there is less.
  std::string_view raw(std::size_t bytes, const char* what);
  [[nodiscard]] std::string_view following() const { return text_.substr(text_.size() - scanner_.remaining()); }

  /// Goes behind the next line that is empty.
  void skip_paragraph();

  /// Errors: InputError when the text left cannot hold that many, of at least `each` bytes.
  void require_room(std::size_t count, std::size_t each, const char* what);

  /// Errors: InputError, always, with the file and the line.
  [[noreturn]] void fail(const std::string& what) const;

private:
  void go_to_token(const char* what);

  std::string_view text_;
  const std::string& name_;
  TextScanner scanner_;
};

/// Cells as VTK has them, in either format.
struct VtkCells {
  std::vector<std::int64_t> types;         ///< #C
  std::vector<std::int64_t> ends;          ///< #C: where the corners of each end
  std::vector<std::int64_t> connectivity;  ///< corners, one cell after the other
};

/// @param first  number of the mesh's first vertex, `vertices`: how many there are for these cells
/// Errors: InputError: ends out of order, corners that do not exist, cells that are not understood.
void add_cells(const VtkCells& cells, std::size_t first, std::size_t vertices, const std::string& name,
               Collector& into);

/// Three numbers a point. Errors: InputError when there are more of them than can be counted.
void add_points(std::span<const double> coordinates, const std::string& name, Collector& into);

}  // namespace tunica::tets
