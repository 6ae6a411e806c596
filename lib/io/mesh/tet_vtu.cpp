// VTK's XML format for unstructured grids. Its XML is plain: a small strict scanner finds the few elements that matter,
// and no entity, declaration or link is followed.
//
// An array in bytes begins with a header: their number, or, compressed, the sizes of the blocks. In base64 header and
// data are one text or one each; padding between them is passed over.
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/io/file/encoding.hpp"
#include "tunica/io/mesh/detail/tet_formats.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <memory>
#include <optional>

namespace tunica::tets {
namespace {

std::optional<NumberType> vtu_scalar(std::string_view word) {
  static const std::map<std::string, NumberType, std::less<>> scalars = {
      {"Int8", NumberType::int8},      {"UInt8", NumberType::uint8},   {"Int16", NumberType::int16},
      {"UInt16", NumberType::uint16},  {"Int32", NumberType::int32},   {"UInt32", NumberType::uint32},
      {"Int64", NumberType::int64},    {"UInt64", NumberType::uint64}, {"Float32", NumberType::float32},
      {"Float64", NumberType::float64}};
  const auto found = scalars.find(word);
  return found == scalars.end() ? std::nullopt : std::optional(found->second);
}

// Bytes that are read from the front.
class ByteStream {
public:
  virtual ~ByteStream() = default;
  /// @return exactly that many bytes. Errors: InputError when there are fewer.
  virtual std::string take(std::size_t bytes) = 0;
  /// At most as many as are there, and not many more.
  [[nodiscard]] virtual std::size_t left() const = 0;
};

[[noreturn]] void vtu_truncated(const std::string& name) {
  throw InputError(fmt::format("{}: is truncated: an array has fewer bytes than it promises", name));
}

class RawStream : public ByteStream {
public:
  RawStream(std::string_view bytes, const std::string& name) : bytes_(bytes), name_(name) {}
  std::string take(std::size_t bytes) override {
    if (bytes > bytes_.size()) {
      vtu_truncated(name_);
    }
    std::string taken(bytes_.substr(0, bytes));
    bytes_.remove_prefix(bytes);
    return taken;
  }
  [[nodiscard]] std::size_t left() const override { return bytes_.size(); }

private:
  std::string_view bytes_;
  const std::string& name_;
};

class Base64Stream : public ByteStream {
public:
  Base64Stream(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  std::string take(std::size_t bytes) override {
    if (bytes > left()) {
      vtu_truncated(name_);
    }
    std::string taken;
    taken.reserve(bytes + 3);
    taken.swap(over_);
    while (taken.size() < bytes) {
      decode_four(taken);
    }
    over_ = taken.substr(bytes);
    taken.resize(bytes);
    return taken;
  }
  [[nodiscard]] std::size_t left() const override { return over_.size() + 3 * (text_.size() / 4); }

private:
  // Value of a sign, 64 for padding.
  std::uint32_t next_sign() {
    while (!text_.empty()) {
      const char sign = text_.front();
      text_.remove_prefix(1);
      if (sign >= 'A' && sign <= 'Z') {
        return static_cast<std::uint32_t>(sign - 'A');
      }
      if (sign >= 'a' && sign <= 'z') {
        return static_cast<std::uint32_t>(sign - 'a' + 26);
      }
      if (sign >= '0' && sign <= '9') {
        return static_cast<std::uint32_t>(sign - '0' + 52);
      }
      if (sign == '+' || sign == '/') {
        return sign == '+' ? 62 : 63;
      }
      if (sign == '=') {
        return 64;
      }
      if (sign != ' ' && sign != '\t' && sign != '\n' && sign != '\r') {
        throw InputError(fmt::format("{}: an array in base64 has the sign {:#04x} in it", name_,
                                     static_cast<unsigned>(static_cast<unsigned char>(sign))));
      }
    }
    vtu_truncated(name_);
  }

  void decode_four(std::string& onto) {
    std::uint32_t word = 0;
    std::size_t signs = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const std::uint32_t value = next_sign();
      if (value == 64 ? k < 2 : signs < k) {
        throw InputError(fmt::format("{}: an array in base64 has its padding in the wrong place", name_));
      }
      signs += value == 64 ? 0 : 1;
      word = word << 6 | (value & 63);
    }
    for (std::size_t k = 0; k + 1 < signs; ++k) {
      onto.push_back(static_cast<char>(static_cast<unsigned char>(word >> (16 - 8 * k))));
    }
  }

  std::string_view text_;
  const std::string& name_;
  std::string over_;
};

struct XmlTag {
  std::string_view name;
  std::map<std::string_view, std::string_view> attributes;
  bool closing = false;  // </name>
  bool empty = false;    // <name/>

  [[nodiscard]] std::string_view get(std::string_view attribute, std::string_view otherwise = {}) const {
    const auto found = attributes.find(attribute);
    return found == attributes.end() ? otherwise : found->second;
  }
};

// Goes from tag to tag.
class XmlScanner {
public:
  XmlScanner(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  /// None at the end of the text.
  std::optional<XmlTag> next() {
    while (true) {
      at_ = std::min(text_.find('<', at_), text_.size());
      if (at_ == text_.size()) {
        return std::nullopt;
      }
      if (text_.substr(at_).starts_with("<!--")) {
        pass("-->");
      } else if (text_.substr(at_).starts_with("<?")) {
        pass("?>");
      } else if (text_.substr(at_).starts_with("<!")) {
        fail("declarations are not understood");
      } else {
        return tag();
      }
    }
  }

  /// What stands behind the last tag up to the next one, and all there is.
  [[nodiscard]] std::string_view content() const { return text_.substr(at_, text_.find('<', at_) - at_); }
  [[nodiscard]] std::string_view rest() const { return text_.substr(at_); }

  [[noreturn]] void fail(const std::string& what) const {
    const auto line =
        1 + std::count(text_.begin(), text_.begin() + narrow<std::ptrdiff_t>(std::min(at_, text_.size())), '\n');
    throw InputError(fmt::format("{}: line {}: {}", name_, line, what));
  }

private:
  void pass(std::string_view mark) {
    const std::size_t found = text_.find(mark, at_);
    if (found == std::string_view::npos) {
      fail("is truncated: a comment has no end");
    }
    at_ = found + mark.size();
  }

  static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

  char peek() {
    if (at_ >= text_.size()) {
      fail("is truncated: it ends within a tag");
    }
    return text_[at_];
  }

  void skip_blanks() {
    while (is_blank(peek())) {
      ++at_;
    }
  }

  std::string_view word() {
    const std::size_t begin = at_;
    while (!is_blank(peek()) && text_[at_] != '=' && text_[at_] != '>' && text_[at_] != '/' && text_[at_] != '<') {
      ++at_;
    }
    if (at_ == begin) {
      fail("a name is expected in a tag");
    }
    return text_.substr(begin, at_ - begin);
  }

  XmlTag tag() {
    XmlTag tag;
    ++at_;
    if (peek() == '/') {
      tag.closing = true;
      ++at_;
    }
    tag.name = word();
    for (skip_blanks(); peek() != '>'; skip_blanks()) {
      if (text_[at_] == '/') {
        tag.empty = true;
        ++at_;
        if (peek() != '>') {
          fail("/ stands within a tag");
        }
        break;
      }
      const std::string_view attribute = word();
      skip_blanks();
      if (text_[at_] != '=') {
        fail(fmt::format("the attribute {} has no value", attribute));
      }
      ++at_;
      skip_blanks();
      const char quote = text_[at_];
      const std::size_t end = quote == '"' || quote == '\'' ? text_.find(quote, at_ + 1) : std::string_view::npos;
      if (end == std::string_view::npos) {
        fail(fmt::format("the value of the attribute {} does not stand in quotes", attribute));
      }
      tag.attributes[attribute] = text_.substr(at_ + 1, end - at_ - 1);
      at_ = end + 1;
    }
    ++at_;
    return tag;
  }

  std::string_view text_;
  const std::string& name_;
  std::size_t at_ = 0;
};

// An array where it stands: its tag and the text within.
struct VtuArrayText {
  XmlTag tag;
  std::string_view content;
};

struct VtuPiece {
  std::size_t points = 0;
  std::size_t cells = 0;
  std::optional<VtuArrayText> coordinates, connectivity, offsets, types;
};

class VtuReader {
public:
  VtuReader(std::string_view bytes, const std::string& name) : scanner_(bytes, name), name_(name) {}

  void read(Collector& into) {
    find_arrays();
    if (pieces_.empty()) {
      throw InputError(fmt::format("{}: is truncated, or no VTK file of an unstructured grid: it has no Piece", name_));
    }
    for (const VtuPiece& piece : pieces_) {
      read_piece(piece, into);
    }
    // As VTK's own reader leaves them: which of their vertices are meant to be the same, the file does not say.
    const auto full = std::count_if(pieces_.begin(), pieces_.end(), [](const auto& piece) { return piece.cells > 0; });
    if (full > 1) {
      into.remark(fmt::format("has {} pieces, whose vertices are not joined", full));
    }
  }

private:
  void find_arrays() {
    std::vector<std::string_view> open;
    while (const auto tag = scanner_.next()) {
      if (tag->closing) {
        if (open.empty() || open.back() != tag->name) {
          scanner_.fail(fmt::format("</{}> closes nothing", tag->name));
        }
        open.pop_back();
        continue;
      }
      if (open.empty() && tag->name != "VTKFile") {
        scanner_.fail("a VTK file in XML begins with <VTKFile");
      }
      begin_element(*tag, open.empty() ? "" : open.back());
      if (tag->name == "AppendedData" && !tag->empty) {
        appended_ = scanner_.rest();
        return;  // bytes, which may look like tags
      }
      if (!tag->empty) {
        open.push_back(tag->name);
      }
    }
    if (!open.empty()) {
      throw InputError(fmt::format("{}: is truncated: <{}> has no end", name_, open.back()));
    }
  }

  void begin_element(const XmlTag& tag, std::string_view parent) {
    if (tag.name == "VTKFile") {
      read_head(tag);
    } else if (tag.name == "Piece") {
      pieces_.push_back({count(tag, "NumberOfPoints"), count(tag, "NumberOfCells"), {}, {}, {}, {}});
    } else if (tag.name == "AppendedData") {
      appended_base64_ = tag.get("encoding") == "base64";
      if (!appended_base64_ && tag.get("encoding") != "raw") {
        scanner_.fail("AppendedData is in base64 or raw");
      }
    } else if (tag.name == "DataArray" && !pieces_.empty() && (parent == "Points" || parent == "Cells")) {
      const VtuArrayText array{tag, tag.empty ? std::string_view() : scanner_.content()};
      VtuPiece& piece = pieces_.back();
      const std::string_view name = tag.get("Name");
      if (parent == "Points") {
        keep(piece.coordinates, array);
      } else if (name == "connectivity") {
        keep(piece.connectivity, array);
      } else if (name == "offsets") {
        keep(piece.offsets, array);
      } else if (name == "types") {
        keep(piece.types, array);
      }
    }
  }

  void keep(std::optional<VtuArrayText>& place, const VtuArrayText& array) {
    if (place) {
      scanner_.fail("an array is there twice");
    }
    place = array;
  }

  void read_head(const XmlTag& tag) {
    if (tag.get("type") != "UnstructuredGrid") {
      scanner_.fail(
          fmt::format("is a VTK file of type \"{}\", tetrahedra are read from UnstructuredGrid only", tag.get("type")));
    }
    const std::string_view order = tag.get("byte_order", "LittleEndian");
    const std::string_view header = tag.get("header_type", "UInt32");
    const std::string_view compressor = tag.get("compressor");
    if (order != "LittleEndian" && order != "BigEndian") {
      scanner_.fail("byte_order is LittleEndian or BigEndian");
    }
    if (header != "UInt32" && header != "UInt64") {
      scanner_.fail("header_type is UInt32 or UInt64");
    }
    if (!compressor.empty() && compressor != "vtkZLibDataCompressor") {
      scanner_.fail(fmt::format("{} is not understood: save the file with zlib, or without compression", compressor));
    }
    order_ = order == "BigEndian" ? ByteOrder::big : ByteOrder::little;
    header_ = header == "UInt64" ? NumberType::uint64 : NumberType::uint32;
    compressed_ = !compressor.empty();
  }

  std::size_t count(const XmlTag& tag, std::string_view attribute) const {
    TextScanner text(tag.get(attribute));
    const auto value = text.next_line() ? text.integer() : std::nullopt;
    if (!value || *value < 0 || narrow<std::size_t>(*value) > max_index || !text.at_line_end()) {
      scanner_.fail(fmt::format("{} of {} is no count", attribute, tag.name));
    }
    return narrow<std::size_t>(*value);
  }

  void read_piece(const VtuPiece& piece, Collector& into) {
    const auto need = [&](const std::optional<VtuArrayText>& array, const char* what) -> const VtuArrayText& {
      if (!array) {
        throw InputError(fmt::format("{}: has a Piece without {}", name_, what));
      }
      return *array;
    };
    if (piece.points == 0 && piece.cells == 0) {
      return;  // writers in parallel leave such
    }
    const std::vector<double> coordinates = numbers<double>(need(piece.coordinates, "Points"), "Points");
    require_count(coordinates.size(), 3 * piece.points, "coordinates");
    VtkCells cells;
    cells.types = numbers<std::int64_t>(need(piece.types, "types of cells"), "types");
    cells.ends = numbers<std::int64_t>(need(piece.offsets, "offsets of cells"), "offsets");
    cells.connectivity = numbers<std::int64_t>(need(piece.connectivity, "connectivity of cells"), "connectivity");
    require_count(cells.types.size(), piece.cells, "types of cells");
    require_count(cells.ends.size(), piece.cells, "offsets of cells");
    const std::size_t first = into.vertices.size();
    add_points(coordinates, name_, into);
    add_cells(cells, first, piece.points, name_, into);
  }

  void require_count(std::size_t found, std::size_t promised, const char* what) const {
    if (found != promised) {
      throw InputError(fmt::format("{}: {} {} are promised, {} are there", name_, promised, what, found));
    }
  }

  template <typename Number>
  std::vector<Number> numbers(const VtuArrayText& array, const char* what) {
    const auto type = vtu_scalar(array.tag.get("type"));
    if (!type || (!std::is_same_v<Number, double> && !is_whole(*type))) {
      throw InputError(fmt::format("{}: {} has the type \"{}\", {} are expected", name_, what, array.tag.get("type"),
                                   std::is_same_v<Number, double> ? "numbers" : "whole numbers"));
    }
    const std::string_view format = array.tag.get("format", "ascii");
    if (format == "ascii") {
      return numbers_in_text<Number>(array.content, what);
    }
    if (format != "binary" && format != "appended") {
      throw InputError(
          fmt::format("{}: {} has the format \"{}\"; ascii, binary and appended are understood", name_, what, format));
    }
    const std::string bytes =
        format == "binary" ? bytes_of(Base64Stream(array.content, name_), what) : appended(array.tag, what);
    if (bytes.size() % size_of(*type) != 0) {
      throw InputError(fmt::format("{}: {} has {} bytes, which is no number of {}", name_, what, bytes.size(),
                                   array.tag.get("type")));
    }
    if constexpr (std::is_same_v<Number, double>) {
      return decoded_numbers(bytes, *type, order_);
    } else {
      return decoded_integers(bytes, *type, order_);
    }
  }

  template <typename Number>
  std::vector<Number> numbers_in_text(std::string_view content, const char* what) {
    std::vector<Number> values;
    TextScanner text(content);
    while (text.next_line()) {
      while (!text.at_line_end()) {
        std::optional<Number> value;
        if constexpr (std::is_same_v<Number, double>) {
          value = text.number();
        } else {
          value = text.integer();
        }
        if (!value) {
          throw InputError(fmt::format("{}: {} holds \"{}\", which is no {}number", name_, what,
                                       text.token().substr(0, 40), std::is_same_v<Number, double> ? "" : "whole "));
        }
        values.push_back(*value);
      }
    }
    return values;
  }

  std::string appended(const XmlTag& tag, const char* what) {
    const std::size_t mark = appended_.find_first_not_of(" \t\r\n");
    if (mark == std::string_view::npos || appended_[mark] != '_') {
      throw InputError(fmt::format("{}: is truncated: {} stands in AppendedData, which is not there", name_, what));
    }
    TextScanner text(tag.get("offset"));
    const auto offset = text.next_line() ? text.integer() : std::nullopt;
    const std::string_view data = appended_.substr(mark + 1);
    if (!offset || *offset < 0 || narrow<std::size_t>(*offset) > data.size()) {
      throw InputError(
          fmt::format("{}: {} begins beyond the end of the appended data, at \"{}\"", name_, what, tag.get("offset")));
    }
    const std::string_view begin = data.substr(narrow<std::size_t>(*offset));
    return appended_base64_ ? bytes_of(Base64Stream(begin, name_), what) : bytes_of(RawStream(begin, name_), what);
  }

  // A number of a header. Errors: InputError when it cannot be one.
  std::size_t header_number(ByteStream& stream) {
    const std::int64_t value = decoded_integers(stream.take(size_of(header_)), header_, order_).front();
    if (value < 0) {
      vtu_truncated(name_);
    }
    return narrow<std::size_t>(value);
  }

  // The bytes of an array behind its header.
  std::string bytes_of(ByteStream&& stream, const char* what) {
    if (!compressed_) {
      return stream.take(header_number(stream));
    }
    const std::size_t blocks = header_number(stream);
    const std::size_t block = header_number(stream);
    const std::size_t last = header_number(stream);
    // The size of a block says nothing where there is only the last one, which may be smaller.
    const std::size_t whole = last > 0 && blocks > 0 ? blocks - 1 : blocks;
    const std::size_t most = stream.left() * deflate_expansion;
    if (blocks > stream.left() / size_of(header_) || (whole > 0 && block > most / whole) || last > block ||
        last > most) {
      throw InputError(fmt::format("{}: is truncated: {} of {} blocks of {} bytes cannot be in the bytes that are left",
                                   name_, what, blocks, block));
    }
    std::vector<std::size_t> sizes(blocks);
    std::generate(sizes.begin(), sizes.end(), [&] { return header_number(stream); });
    std::string bytes;
    for (std::size_t i = 0; i < blocks; ++i) {
      const std::string packed = stream.take(sizes[i]);
      const std::size_t expected = i + 1 == blocks && last > 0 ? last : block;
      // No more memory than a block can need, even when the next block proves to be a lie.
      if (expected > packed.size() * deflate_expansion) {
        vtu_truncated(name_);
      }
      const std::size_t begin = bytes.size();
      bytes.resize(begin + expected);
      uLongf size = expected;
      const int status = ::uncompress(reinterpret_cast<Bytef*>(bytes.data() + begin), &size,
                                      reinterpret_cast<const Bytef*>(packed.data()), packed.size());
      if (status == Z_MEM_ERROR) {
        throw std::bad_alloc();
      }
      if (status != Z_OK || size != expected) {
        throw InputError(fmt::format("{}: {} cannot be decompressed: block {} is damaged", name_, what, i));
      }
      check_interrupt();
    }
    return bytes;
  }

  XmlScanner scanner_;
  const std::string& name_;
  ByteOrder order_ = ByteOrder::little;
  NumberType header_ = NumberType::uint32;
  bool compressed_ = false;
  std::vector<VtuPiece> pieces_;
  std::string_view appended_;
  bool appended_base64_ = false;
};

}  // namespace

void read_vtu(std::string_view bytes, const std::string& name, Collector& into) { VtuReader(bytes, name).read(into); }

}  // namespace tunica::tets
